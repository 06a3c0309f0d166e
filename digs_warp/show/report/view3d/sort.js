// The order in which Gaussians are drawn: the farthest first.

const BINS = 1 << 16;

class DepthOrder {
  constructor(centers) {
    this.centers = centers;
    this.count = centers.length / 3;
    this.bins = new Uint16Array(this.count);
    this.order = new Uint32Array(this.count);
  }

  // Sorts those in front of the near plane by the logarithm of their depth (counting sort); returns how many, and
  // sets `range` to the depths of nearly all of them.
  sort({ eye, axes }, near) {
    const [x, y, z] = axes[2];
    const offset = dot(eye, axes[2]);
    const depths = new Float32Array(this.count);
    let far = 2 * near;
    for (let i = 0; i < this.count; i++) {
      const c = 3 * i;
      depths[i] =
        x * this.centers[c] + y * this.centers[c + 1] + z * this.centers[c + 2] - offset;
      if (depths[i] > far) far = depths[i];
    }
    const scale = (BINS - 1) / Math.log(far / near);
    const starts = new Uint32Array(BINS + 1);
    let shown = 0;
    for (let i = 0; i < this.count; i++) {
      if (depths[i] <= near) continue;
      this.bins[i] = BINS - 1 - Math.floor(scale * Math.log(depths[i] / near));
      starts[this.bins[i] + 1]++;
      shown++;
    }
    for (let bin = 0; bin < BINS; bin++) starts[bin + 1] += starts[bin];
    const depthAt = (share) => {
      const bin = starts.findIndex((before) => before >= share * shown);
      return near * Math.exp((BINS - 1 - bin) / scale);
    };
    this.range = [depthAt(0.98), depthAt(0.02)];
    for (let i = 0; i < this.count; i++) {
      if (depths[i] > near) this.order[starts[this.bins[i]]++] = i;
    }
    return shown;
  }
}
