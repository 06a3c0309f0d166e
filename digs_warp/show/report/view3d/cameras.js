// The cameras of the recording as lines: their path, and a pyramid for each. Those held out have a cross.

const PATH_TINT = [0.42, 0.45, 0.5];
const TRAINING_TINT = [0.12, 0.4, 0.72];
const HELD_OUT_TINT = [0.76, 0.33, 0.0];

// Returns x, y, z, red, green, blue of every end; `depth` is how long a pyramid is [m]; all of it moved by an offset.
function cameraLines({ list, depth, halfWidth, halfHeight }, offset) {
  const ends = [];
  const line = (from, to, tint) => ends.push(...add(from, offset), ...tint, ...add(to, offset), ...tint);
  let before = null;
  for (const { eye, right, down, forward, heldOut } of list) {
    const tint = heldOut ? HELD_OUT_TINT : TRAINING_TINT;
    const corner = (x, y) =>
      add(add(add(eye, forward, depth), right, x * halfWidth * depth), down, y * halfHeight * depth);
    const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)];
    corners.forEach((at, i) => {
      line(eye, at, tint);
      line(at, corners[(i + 1) % 4], tint);
    });
    if (heldOut) {
      line(corners[0], corners[2], tint);
      line(corners[1], corners[3], tint);
    }
    if (before) line(before, eye, PATH_TINT);
    before = eye;
  }
  return ends;
}
