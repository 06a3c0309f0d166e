// Draws Gaussians and lines with WebGL 2. The projection is that of the rasterizer (docs/research/rasterizer.md).

const SPLAT_VERTEX = `#version 300 es
precision highp float;
uniform highp sampler2D splats;
uniform mat3 axes;  // columns: right, down, forward in the world
uniform vec3 eye;
uniform vec2 size;  // of the image [px]
uniform float focal, near;
in vec2 corner;
in uint splat;
uniform float dilation;  // [px^2]
uniform bool antialias;
out vec2 place;  // in standard deviations
out vec4 color;

vec4 texel(int number) {
  int i = int(splat);
  return texelFetch(splats, ivec2(${TEXELS} * (i % ${PER_ROW}) + number, i / ${PER_ROW}), 0);
}

void main() {
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);  // outside
  vec4 first = texel(0), second = texel(1), third = texel(2);
  vec3 p = (first.xyz - eye) * axes;
  if (p.z < near) return;
  mat3 sigma = mat3(second.x, second.y, second.z, second.y, second.w, third.x, second.z, third.x, third.y);
  vec2 limit = 1.3 * 0.5 * size / focal;
  vec2 t = clamp(p.xy / p.z, -limit, limit);
  vec3 u = focal / p.z * (axes * vec3(1.0, 0.0, -t.x));
  vec3 v = focal / p.z * (axes * vec3(0.0, 1.0, -t.y));
  float a = dot(u, sigma * u), b = dot(u, sigma * v), c = dot(v, sigma * v);
  float before = max(a * c - b * b, 0.0);
  a += dilation;
  c += dilation;
  float opacity = first.w * (antialias ? sqrt(before / (a * c - b * b)) : 1.0);
  if (opacity < 1.0 / 255.0) return;
  float middle = 0.5 * (a + c), half_gap = length(vec2(0.5 * (a - c), b));
  vec2 spread = sqrt(vec2(middle + half_gap, max(middle - half_gap, dilation)));
  vec2 along = abs(b) > 1e-6 * middle ? normalize(vec2(b, middle + half_gap - a))
    : (a >= c ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
  place = corner * sqrt(2.0 * log(255.0 * opacity));  // to where alpha is 1/255
  vec2 offset = place.x * spread.x * along + place.y * spread.y * vec2(-along.y, along.x);
  vec2 px = focal * p.xy / p.z + offset;
  gl_Position = vec4(2.0 * px.x / size.x, -2.0 * px.y / size.y, 0.0, 1.0);
  float rgb = third.z;
  color = vec4(floor(rgb / 65536.0), mod(floor(rgb / 256.0), 256.0), mod(rgb, 256.0), 0.0) / 255.0;
  color.a = opacity;
}`;

const SPLAT_FRAGMENT = `#version 300 es
precision highp float;
in vec2 place;
in vec4 color;
out vec4 painted;
void main() {
  float alpha = min(0.99, color.a * exp(-0.5 * dot(place, place)));
  if (alpha < 1.0 / 255.0) discard;
  painted = vec4(color.rgb * alpha, alpha);
}`;

const LINE_VERTEX = `#version 300 es
precision highp float;
uniform mat3 axes;
uniform vec3 eye;
uniform vec2 size, shift;  // [px]
uniform float focal, near;
in vec3 point;
in vec3 tint;
out vec3 color;
out float depth;
void main() {
  vec3 p = (point - eye) * axes;
  color = tint;
  depth = p.z;
  vec2 px = focal * p.xy + shift * p.z;
  // z: clipped where nearer than the near plane.
  gl_Position = vec4(2.0 * px.x / size.x, -2.0 * px.y / size.y, p.z - 2.0 * near, p.z);
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
uniform float divide;  // only what lies on this side of that depth is drawn
uniform float side;
in vec3 color;
in float depth;
out vec4 painted;
void main() {
  if (side * (depth - divide) < 0.0) discard;
  painted = vec4(color, 1.0);
}`;

// Keeps the inverse of the covariance of an infinitely thin splat finite [px^2].
const LEAST_DILATION = 0.01;

// WebGL draws lines one pixel wide: several beside each other are wider.
const LINE_SHIFTS = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];

class Drawing {
  // filter: what the splats are drawn with, its dilation in px^2 and whether it is antialiased.
  // lines: x, y, z, red, green, blue of every end. Throws where WebGL 2 cannot do it.
  constructor(canvas, splats, filter, lines) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: true, depth: false });
    if (!gl) throw new Error("no WebGL 2");
    this.gl = gl;
    this.filter = filter;
    this.order = new DepthOrder(splats.centers);
    this.ends = lines.length / 6;
    this.splatProgram = program(gl, SPLAT_VERTEX, SPLAT_FRAGMENT);
    this.lineProgram = program(gl, LINE_VERTEX, LINE_FRAGMENT);
    this.splatShape = gl.createVertexArray();
    gl.bindVertexArray(this.splatShape);
    attribute(gl, this.splatProgram, "corner", new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]), 2, 8, 0);
    this.orderBuffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.orderBuffer);
    const splat = gl.getAttribLocation(this.splatProgram, "splat");
    gl.enableVertexAttribArray(splat);
    gl.vertexAttribIPointer(splat, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(splat, 1);
    this.lineShape = gl.createVertexArray();
    gl.bindVertexArray(this.lineShape);
    attribute(gl, this.lineProgram, "point", new Float32Array(lines), 3, 24, 0);
    attribute(gl, this.lineProgram, "tint", new Float32Array(lines), 3, 24, 12);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texImage2D(
      gl.TEXTURE_2D, 0, gl.RGBA32F, TEXELS * PER_ROW, splats.rows, 0, gl.RGBA, gl.FLOAT, splats.texels,
    );
    if (gl.getError() !== gl.NO_ERROR) throw new Error("WebGL 2 cannot hold the Gaussians");
  }

  // Draws the view of an orbit; returns the number of Gaussians in front of the camera.
  draw(orbit, withLines) {
    const { gl } = this;
    const pose = orbit.pose();
    const near = 0.05 * orbit.distance;
    const shown = this.order.sort(pose, near);
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (withLines) this.drawLines(orbit, pose, near, 1);
    gl.bindVertexArray(this.splatShape);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.orderBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.order.order, gl.DYNAMIC_DRAW, 0, shown);
    this.setView(this.splatProgram, orbit, pose, near);
    gl.uniform1f(gl.getUniformLocation(this.splatProgram, "dilation"), Math.max(this.filter.dilation, LEAST_DILATION));
    gl.uniform1i(gl.getUniformLocation(this.splatProgram, "antialias"), this.filter.antialias ? 1 : 0);
    if (shown) gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, shown);
    if (withLines) this.drawLines(orbit, pose, near, -1);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits until it is drawn
    return shown;
  }

  // side: 1 draws what lies behind the target, -1 what lies before it.
  drawLines(orbit, pose, near, side) {
    const { gl } = this;
    this.setView(this.lineProgram, orbit, pose, near);
    gl.uniform1f(gl.getUniformLocation(this.lineProgram, "divide"), orbit.distance);
    gl.uniform1f(gl.getUniformLocation(this.lineProgram, "side"), side);
    gl.bindVertexArray(this.lineShape);
    for (const shift of LINE_SHIFTS) {
      gl.uniform2fv(gl.getUniformLocation(this.lineProgram, "shift"), shift);
      gl.drawArrays(gl.LINES, 0, this.ends);
    }
  }

  setView(used, orbit, { eye, axes }, near) {
    const { gl } = this;
    const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
    const at = (name) => gl.getUniformLocation(used, name);
    gl.useProgram(used);
    gl.uniformMatrix3fv(at("axes"), false, axes.flat());
    gl.uniform3fv(at("eye"), eye);
    gl.uniform2f(at("size"), width, height);
    gl.uniform1f(at("focal"), orbit.focal(width, height));
    gl.uniform1f(at("near"), near);
  }
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return made;
}

function attribute(gl, used, name, values, size, stride, offset) {
  const at = gl.getAttribLocation(used, name);
  gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
  gl.enableVertexAttribArray(at);
  gl.vertexAttribPointer(at, size, gl.FLOAT, false, stride, offset);
}
