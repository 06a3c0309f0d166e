// The Gaussians of the page, from the words that view3d/pack.py writes.

const WORDS = 5;
const TEXELS = 3; // of a Gaussian in the texture: RGBA, 32-bit floats
const PER_ROW = 512; // Gaussians in a row of the texture

// Returns the number of Gaussians, their centers (x, y, z each), and a texture's content:
//   x, y, z, opacity | covariance xx, xy, xz, yy | covariance yz, zz, color as 0xRRGGBB, unused
function unpack(base64, about) {
  const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
  const words = new Uint32Array(bytes.buffer);
  const count = words.length / WORDS;
  const rows = Math.max(1, Math.ceil(count / PER_ROW));
  const centers = new Float32Array(3 * count);
  const texels = new Float32Array(4 * TEXELS * PER_ROW * rows);
  for (let i = 0; i < count; i++) {
    const word = words.subarray(WORDS * i, WORDS * (i + 1));
    const at = 4 * TEXELS * i;
    const scales = [0, 0, 0];
    for (let axis = 0; axis < 3; axis++) {
      centers[3 * i + axis] = about.low[axis] + (word[axis] & 0xffffff) * about.step[axis];
      texels[at + axis] = centers[3 * i + axis];
      scales[axis] = Math.exp(about.logLow + (word[axis] >>> 24) * about.logStep);
    }
    texels[at + 3] = (word[4] >>> 24) / 255;
    texels.set(covariance(rotation(quaternion(word[3])), scales), at + 4);
    const [red, green, blue] = [word[4] & 255, (word[4] >>> 8) & 255, (word[4] >>> 16) & 255];
    texels[at + 10] = 65536 * red + 256 * green + blue;
  }
  return { count, centers, texels, rows };
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
