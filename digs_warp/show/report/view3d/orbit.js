// A camera that turns around a point, with OpenCV axes: x right, y down, z forward.

const add = (a, b, share = 1) => a.map((value, i) => value + share * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
const unit = (a) => a.map((value) => value / Math.hypot(...a));

const STEEPEST = (89 * Math.PI) / 180;

class Orbit {
  // start: target, eye and up in the world; halfView: tangent of half the view across the smaller side.
  constructor(start) {
    this.begin(start);
  }

  // Begins somewhere else.
  begin({ target, eye, up, halfView }) {
    this.start = { target, eye, halfView };
    this.up = unit(up);
    const level = Math.abs(this.up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0];
    this.east = unit(add(level, this.up, -dot(level, this.up)));
    this.north = cross(this.up, this.east);
    this.reset();
  }

  reset() {
    this.halfView = this.start.halfView;
    this.look(this.start.eye, this.start.target);
  }

  // Looks from an eye at a target.
  look(eye, target) {
    const away = add(eye, target, -1);
    this.target = [...target];
    this.distance = Math.hypot(...away);
    this.elevation = Math.asin(dot(away, this.up) / this.distance);
    this.azimuth = Math.atan2(dot(away, this.north), dot(away, this.east));
    this.turn(0, 0);
  }

  // Looks as a recorded camera, whose image just fits into a view of this size; it may be held askew.
  take({ eye, right, forward }, { halfWidth, halfHeight }, width, height) {
    const ahead = dot(add(this.target, eye, -1), forward);
    this.look(eye, add(eye, forward, ahead > 0 ? ahead : this.distance));
    const { axes } = this.pose();
    this.roll = Math.atan2(dot(right, axes[1]), dot(right, axes[0]));
    const focal = Math.min((0.5 * width) / halfWidth, (0.5 * height) / halfHeight);
    this.halfView = (0.5 * Math.min(width, height)) / focal;
  }

  turn(azimuth, elevation) {
    this.roll = 0;
    this.azimuth += azimuth;
    this.elevation = Math.min(STEEPEST, Math.max(-STEEPEST, this.elevation + elevation));
  }

  zoom(factor) {
    const first = Math.hypot(...add(this.start.eye, this.start.target, -1));
    this.distance = Math.min(20 * first, Math.max(0.02 * first, this.distance * factor));
  }

  // Moves the target across the view, in shares of the smaller side.
  pan(right, down) {
    const { axes } = this.pose();
    const size = 2 * this.halfView * this.distance;
    this.target = add(add(this.target, axes[0], -right * size), axes[1], -down * size);
  }

  // The eye, and right, down and forward in the world.
  pose() {
    const level = Math.cos(this.elevation);
    const away = [0, 1, 2].map(
      (i) =>
        level * (Math.cos(this.azimuth) * this.east[i] + Math.sin(this.azimuth) * this.north[i]) +
        Math.sin(this.elevation) * this.up[i],
    );
    const forward = away.map((value) => -value);
    const straight = unit(cross(forward, this.up));
    const below = cross(forward, straight);
    const [c, s] = [Math.cos(this.roll), Math.sin(this.roll)];
    const right = add(straight.map((value) => c * value), below, s);
    return {
      eye: add(this.target, away, this.distance),
      axes: [right, cross(forward, right), forward],
    };
  }

  // Focal length [px] of an image of this size.
  focal(width, height) {
    return (0.5 * Math.min(width, height)) / this.halfView;
  }
}
