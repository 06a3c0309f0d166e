// Gaussians from the bytes that view3d/pack.py writes, and several sets of them as the textures of one drawing.

const WORDS = 5;
const TEXELS = 4; // of a Gaussian in the texture: RGBA, 32-bit floats
const PER_ROW = 256; // Gaussians in a row of the textures
const ANTIALIASED = 1000; // added to the dilation, which is at most 100

// The Gaussians of one set: their number, centers (x, y, z each), harmonics (r, g, b of each of `bands`), texels:
//   x, y, z, opacity | covariance xx, xy, xz, yy | yz, zz, color as 0xRRGGBB, dilation | normal, of a harmonic's step
function unpack(bytes, about) {
  const count = about.count;
  const words = new Uint32Array(bytes.buffer, 0, WORDS * count);
  const harmonics = new Int8Array(bytes.buffer, 4 * WORDS * count);
  const centers = new Float32Array(3 * count);
  const texels = new Float32Array(4 * TEXELS * count);
  const filter = about.dilation + (about.antialias ? ANTIALIASED : 0);
  for (let i = 0; i < count; i++) {
    const word = words.subarray(WORDS * i, WORDS * (i + 1));
    const at = 4 * TEXELS * i;
    const scales = [0, 0, 0];
    for (let axis = 0; axis < 3; axis++) {
      centers[3 * i + axis] = about.low[axis] + (word[axis] & 0xffffff) * about.step[axis];
      scales[axis] = Math.exp(about.logLow + (word[axis] >>> 24) * about.logStep);
    }
    const turned = rotation(quaternion(word[3]));
    const thin = scales.indexOf(Math.min(...scales));
    texels[at + 3] = (word[4] >>> 24) / 255;
    texels.set(covariance(turned, scales), at + 4);
    const [red, green, blue] = [word[4] & 255, (word[4] >>> 8) & 255, (word[4] >>> 16) & 255];
    texels[at + 10] = 65536 * red + 256 * green + blue;
    texels[at + 11] = filter;
    texels.set([...turned.map((row) => row[thin]), about.harmonicStep], at + 12);
  }
  return { count, centers, texels, harmonics, bands: count ? harmonics.length / (3 * count) : 0 };
}

// parts: sets, each with the offset that it is shown at, and the box [low, high] that it is cut to, or null.
function merged(parts) {
  const most = parts.reduce((sum, { splats }) => sum + splats.count, 0);
  const bands = parts.reduce((found, { splats }) => Math.max(found, splats.bands), 0);
  const rows = Math.max(1, Math.ceil(most / PER_ROW));
  const centers = new Float32Array(3 * most);
  const texels = new Float32Array(4 * TEXELS * PER_ROW * rows);
  const harmonics = new Int8Array(4 * bands * PER_ROW * rows);
  let count = 0;
  for (const { splats, offset, box } of parts) {
    for (let i = 0; i < splats.count; i++) {
      const center = splats.centers.subarray(3 * i, 3 * i + 3);
      if (box && center.some((value, axis) => value < box[0][axis] || value > box[1][axis])) continue;
      const moved = add(Array.from(center), offset);
      centers.set(moved, 3 * count);
      texels.set(splats.texels.subarray(4 * TEXELS * i, 4 * TEXELS * (i + 1)), 4 * TEXELS * count);
      texels.set(moved, 4 * TEXELS * count);
      for (let k = 0; k < splats.bands; k++) {
        const from = 3 * (splats.bands * i + k);
        harmonics.set(splats.harmonics.subarray(from, from + 3), 4 * (bands * count + k));
      }
      count++;
    }
  }
  return { count, bands, rows, texels, harmonics, centers: centers.subarray(0, 3 * count) };
}

function quaternion(word) {
  const largest = word >>> 30;
  const q = [0, 0, 0, 0];
  let rest = 1;
  for (let axis = 0, shift = 0; axis < 4; axis++) {
    if (axis === largest) continue;
    q[axis] = (((word >>> shift) & 1023) / 1023) * Math.SQRT2 - Math.SQRT1_2;
    rest -= q[axis] * q[axis];
    shift += 10;
  }
  q[largest] = Math.sqrt(Math.max(0, rest));
  return q;
}

// The rows of the rotation of a unit quaternion x, y, z, w.
function rotation([x, y, z, w]) {
  return [
    [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
  ];
}

// R S S R^T as xx, xy, xz, yy, yz, zz.
function covariance(r, s) {
  const entry = (i, j) =>
    r[i][0] * r[j][0] * s[0] * s[0] + r[i][1] * r[j][1] * s[1] * s[1] + r[i][2] * r[j][2] * s[2] * s[2];
  return [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
}
