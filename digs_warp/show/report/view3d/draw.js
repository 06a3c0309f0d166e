// Draws Gaussians and lines with WebGL 2. The projection is that of the rasterizer (docs/research/rasterizer.md).

// Keeps the inverse of the covariance of an infinitely thin splat finite [px^2].
const LEAST_DILATION = 0.01;

// What is drawn.
const SHOWN = ["color", "depth", "normals"];

const SPLAT_VERTEX = `#version 300 es
precision highp float;
uniform highp sampler2D splats;
uniform highp isampler2D harmonics;
uniform int bands;  // of the harmonics without the first
uniform int shown;  // 0: color, 1: depth, 2: normals
uniform vec2 range;  // of depths
uniform mat3 axes;  // columns: right, down, forward in the world
uniform vec3 eye;
uniform vec2 size;  // of the image [px]
uniform float focal, near;
in vec2 corner;
in uint splat;
out vec2 place;  // in standard deviations
out vec4 color;

vec4 texel(int number) {
  int i = int(splat);
  return texelFetch(splats, ivec2(${TEXELS} * (i % ${PER_ROW}) + number, i / ${PER_ROW}), 0);
}

// What the color has beside that of band 0, seen along a unit vector (digs_warp/geometry/sh.py).
vec3 gloss(vec3 d, float step_) {
  float x = d.x, y = d.y, z = d.z, xx = x * x, yy = y * y, zz = z * z;
  float basis[15] = float[15](
    -0.48860251 * y, 0.48860251 * z, -0.48860251 * x,
    1.09254843 * x * y, -1.09254843 * y * z, 0.31539157 * (2.0 * zz - xx - yy),
    -1.09254843 * x * z, 0.54627422 * (xx - yy),
    -0.59004359 * y * (3.0 * xx - yy), 2.89061144 * x * y * z, -0.45704580 * y * (4.0 * zz - xx - yy),
    0.37317633 * z * (2.0 * zz - 3.0 * xx - 3.0 * yy), -0.45704580 * x * (4.0 * zz - xx - yy),
    1.44530572 * z * (xx - yy), -0.59004359 * x * (xx - 3.0 * yy));
  int i = int(splat);
  vec3 sum = vec3(0.0);
  for (int k = 0; k < bands; k++) {
    ivec2 at = ivec2(bands * (i % ${PER_ROW}) + k, i / ${PER_ROW});
    sum += basis[k] * vec3(texelFetch(harmonics, at, 0).rgb);
  }
  return step_ * sum;
}

// Violet far, yellow near: a polynomial through matplotlib's viridis.
vec3 viridis(float t) {
  const vec3 c0 = vec3(0.2777273, 0.0054073, 0.3340998), c1 = vec3(0.1050930, 1.4046135, 1.3845902);
  const vec3 c2 = vec3(-0.3308618, 0.2148476, 0.0950952), c3 = vec3(-4.6342305, -5.7991010, -19.3324410);
  const vec3 c4 = vec3(6.2282700, 14.1799333, 56.6905526), c5 = vec3(4.7763850, -13.7451454, -65.3530326);
  const vec3 c6 = vec3(-5.4354559, 4.6458526, 26.3124352);
  return c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * (c5 + t * c6)))));
}

void main() {
  gl_Position = vec4(0.0, 0.0, 2.0, 1.0);  // outside
  vec4 first = texel(0), second = texel(1), third = texel(2), fourth = texel(3);
  vec3 p = (first.xyz - eye) * axes;
  if (p.z < near) return;
  mat3 sigma = mat3(second.x, second.y, second.z, second.y, second.w, third.x, second.z, third.x, third.y);
  vec2 limit = 1.3 * 0.5 * size / focal;
  vec2 t = clamp(p.xy / p.z, -limit, limit);
  vec3 u = focal / p.z * (axes * vec3(1.0, 0.0, -t.x));
  vec3 v = focal / p.z * (axes * vec3(0.0, 1.0, -t.y));
  float a = dot(u, sigma * u), b = dot(u, sigma * v), c = dot(v, sigma * v);
  bool antialias = third.w >= ${ANTIALIASED}.0;
  float dilation = max(antialias ? third.w - ${ANTIALIASED}.0 : third.w, ${LEAST_DILATION});
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
  vec3 seen = vec3(floor(rgb / 65536.0), mod(floor(rgb / 256.0), 256.0), mod(rgb, 256.0)) / 255.0;
  vec3 along_ray = normalize(first.xyz - eye);
  if (shown == 0) seen = clamp(seen + gloss(along_ray, fourth.w), 0.0, 1.0);
  else if (shown == 1) seen = viridis(clamp((range.y - p.z) / max(range.y - range.x, 1e-9), 0.0, 1.0));
  else seen = 0.5 + 0.5 * fourth.xyz * (dot(fourth.xyz, along_ray) > 0.0 ? -1.0 : 1.0);
  color = vec4(seen, opacity);
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

// WebGL draws lines one pixel wide: several beside each other are wider.
const LINE_SHIFTS = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];

class Drawing {
  // Throws where WebGL 2 cannot do it.
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: true, depth: false });
    if (!gl) throw new Error("no WebGL 2");
    this.gl = gl;
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
    this.textures = [gl.createTexture(), gl.createTexture()];
  }

  // Takes what is drawn from now on: `merged` Gaussians, and x, y, z, red, green, blue of every end of a line.
  load(splats, lines) {
    const { gl } = this;
    this.order = new DepthOrder(splats.centers);
    this.bands = splats.bands;
    this.ends = lines.length / 6;
    this.lineShape = gl.createVertexArray();
    gl.bindVertexArray(this.lineShape);
    attribute(gl, this.lineProgram, "point", new Float32Array(lines), 3, 24, 0);
    attribute(gl, this.lineProgram, "tint", new Float32Array(lines), 3, 24, 12);
    const { rows, bands, texels, harmonics } = splats;
    this.fill(0, gl.RGBA32F, TEXELS * PER_ROW, rows, gl.RGBA, gl.FLOAT, texels);
    if (bands) this.fill(1, gl.RGBA8I, bands * PER_ROW, rows, gl.RGBA_INTEGER, gl.BYTE, harmonics);
    else this.fill(1, gl.RGBA8I, 1, 1, gl.RGBA_INTEGER, gl.BYTE, new Int8Array(4));
    if (gl.getError() !== gl.NO_ERROR) throw new Error("WebGL 2 cannot hold the Gaussians");
  }

  fill(unit_, form, width, height, format, type, values) {
    const { gl } = this;
    gl.activeTexture(gl.TEXTURE0 + unit_);
    gl.bindTexture(gl.TEXTURE_2D, this.textures[unit_]);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    gl.texImage2D(gl.TEXTURE_2D, 0, form, width, height, 0, format, type, values);
  }

  // Draws the view of an orbit; returns the number of Gaussians in front of the camera.
  //   shown: a number of `SHOWN`; paper: the color behind everything.
  draw(orbit, withLines, shown, paper) {
    const { gl } = this;
    const pose = orbit.pose();
    const near = 0.05 * orbit.distance;
    const count = this.order.sort(pose, near);
    gl.viewport(0, 0, gl.drawingBufferWidth, gl.drawingBufferHeight);
    gl.clearColor(...paper, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    if (withLines) this.drawLines(orbit, pose, near, 1);
    gl.bindVertexArray(this.splatShape);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.orderBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.order.order, gl.DYNAMIC_DRAW, 0, count);
    this.setView(this.splatProgram, orbit, pose, near);
    const at = (name) => gl.getUniformLocation(this.splatProgram, name);
    gl.uniform1i(at("splats"), 0);
    gl.uniform1i(at("harmonics"), 1);
    gl.uniform1i(at("bands"), this.bands);
    gl.uniform1i(at("shown"), shown);
    gl.uniform2f(at("range"), ...this.order.range);
    if (count) gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
    if (withLines) this.drawLines(orbit, pose, near, -1);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); // waits until it is drawn
    return count;
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
