// Readings of all sensors over the last seconds, each in its own range so far.
const SECONDS = 6;
const ROW = 22;

export default {
  template: `
    <div class="strips" role="img" :aria-label="label">
      <canvas ref="canvas"></canvas>
    </div>`,
  props: { feed: String, label: String },
  mounted() {
    this.frames = [];
    this.low = [];
    this.high = [];
    this.hear = ({ detail }) => {
      if (detail.feed !== this.feed) return;
      this.names = detail.names.sensors;
      if (detail.raw.length !== this.low.length) {
        this.frames = [];
        this.low = Array.from(detail.raw);
        this.high = Array.from(detail.raw);
      }
      detail.raw.forEach((value, i) => {
        this.low[i] = Math.min(this.low[i], value);
        this.high[i] = Math.max(this.high[i], value);
      });
      this.frames.push([detail.time, detail.raw]);
      while (this.frames.length && detail.time - this.frames[0][0] > SECONDS * 1000) this.frames.shift();
      if (!this.waits) this.waits = requestAnimationFrame(() => { this.waits = 0; this.draw(); });
    };
    window.addEventListener("glovecal-frame", this.hear);
  },
  beforeUnmount() {
    window.removeEventListener("glovecal-frame", this.hear);
    cancelAnimationFrame(this.waits);
  },
  methods: {
    draw() {
      const canvas = this.$refs.canvas;
      if (!canvas || !this.low.length) return;
      const ratio = Math.min(window.devicePixelRatio, 2);
      const width = canvas.parentElement.clientWidth, height = ROW * this.low.length;
      if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
        canvas.width = Math.round(width * ratio);
        canvas.height = Math.round(height * ratio);
        canvas.style.height = `${height}px`;
      }
      const style = getComputedStyle(canvas);
      const pen = canvas.getContext("2d");
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, width, height);
      pen.font = "12px sans-serif";
      pen.textBaseline = "middle";
      pen.fillStyle = pen.strokeStyle = style.color;
      const left = 84, now = this.frames[this.frames.length - 1][0];
      for (let i = 0; i < this.low.length; i++) {
        const top = i * ROW, span = this.high[i] - this.low[i] || 1;
        pen.fillText(this.names[i] ?? "", 0, top + ROW / 2);
        pen.beginPath();
        for (const [time, raw] of this.frames) {
          const x = left + (width - left) * (1 - (now - time) / (SECONDS * 1000));
          const y = top + ROW - 3 - (ROW - 6) * ((raw[i] - this.low[i]) / span);
          pen.lineTo(x, y);
        }
        pen.stroke();
      }
    },
  },
};
