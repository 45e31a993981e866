// Plays a stretch of a take on a hand's view, as fast as it was: the predicted hand, the measured one as its ghost.
export default {
  template: `
    <div class="replay" v-show="frames">
      <div class="replay-row">
        <button type="button" class="chart-act" @click="toggle">{{ plays ? "Pause" : "Play" }}</button>
        <input ref="slider" type="range" class="replay-slider" min="0" :max="last" :value="frame" @input="seek"
               aria-label="Moment of the stretch" :aria-valuetext="clock">
        <span class="replay-clock">{{ clock }}</span>
      </div>
      <ul class="tips" aria-label="Distance of fingertips">
        <li v-for="one in tips" :key="one.finger"><span>{{ one.finger }}</span><b>{{ one.distance }}</b></li>
      </ul>
    </div>`,
  props: { document: Object, hand: Number, beside: Object, other: Number },
  data: () => ({ frames: 0, frame: 0, plays: false }),
  computed: {
    last() { return Math.max(0, this.frames - 1); },
    clock() {
      if (!this.frames) return "";
      const times = this.document.time_s;
      return `${(times[this.frame] - this.document.start_s).toFixed(2)} s of ${this.document.name}`;
    },
    tips() {
      if (!this.frames) return [];
      const told = (values) => (values[this.frame] === null ? "–" : `${values[this.frame].toFixed(1)} mm`);
      return Object.entries(this.document.tips_mm).map(([finger, values]) => ({
        finger, distance: this.beside ? `${told(values)} → ${told(this.beside.tips_mm[finger])}` : told(values),
      }));
    },
  },
  mounted() { this.take(); },
  beforeUnmount() { cancelAnimationFrame(this.next); },
  watch: { document() { this.take(); } },
  methods: {
    take() {
      cancelAnimationFrame(this.next);
      this.plays = false;
      this.frames = this.document?.time_s.length ?? 0;
      if (!this.frames) return;
      this.show(0);
      const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;
      if (this.frames > 1 && !isStill) this.toggle();
    },
    show(frame) {
      this.frame = frame;
      const both = [[this.hand, this.document], ...(this.beside ? [[this.other, this.beside]] : [])];
      for (const [hand, { rotations, measured_deg: measured, predicted_deg: predicted }] of both) {
        const named = (angles) => Object.fromEntries(rotations.map((name, i) => [name, angles[i]]));
        getElement(hand).showBoth(named(predicted[frame]), named(measured[frame]));
      }
    },
    seek(event) {
      this.plays = false;
      this.show(Number(event.target.value));
    },
    toggle() {
      this.plays = !this.plays;
      if (!this.plays) return;
      const times = this.document.time_s;
      if (this.frame === this.last) this.show(0);
      const begin = performance.now() - 1000 * (times[this.frame] - times[0]);
      const step = (now) => {
        if (!this.plays) return;
        const at = times[0] + (now - begin) / 1000;
        let frame = this.frame;
        while (frame < this.last && times[frame + 1] <= at) frame += 1;
        if (frame !== this.frame) this.show(frame);
        if (frame === this.last) this.plays = false;
        else this.next = requestAnimationFrame(step);
      };
      this.next = requestAnimationFrame(step);
    },
  },
};
