// A take's hand over its whole time, fetched part by part as it is needed; a cursor goes through its chart.
const AHEAD_S = 8; // of playing, before a part is over, the next one is asked for
const KEPT = 4; // parts
const SPEEDS = [0.25, 0.5, 1, 2, 4];

export default {
  template: `
    <div class="take-replay" role="group" aria-label="Replay">
      <div class="replay-row">
        <button type="button" class="chart-act" @click="toggle">{{ plays ? "Pause" : "Play" }}</button>
        <input type="range" class="replay-slider" min="0" :max="duration" step="0.05" :value="at" @input="seek(Number($event.target.value))"
               aria-label="Moment of the take" :aria-valuetext="clock">
        <span class="replay-clock">{{ clock }}</span>
      </div>
      <div class="replay-row">
        <label class="replay-speed">Speed
          <select v-model.number="speed" @change="again"><option v-for="one in speeds" :key="one" :value="one">{{ one }} ×</option></select>
        </label>
        <button type="button" class="chart-act" @click="$emit('edge', { edge: 'from', at_s: at })">From here</button>
        <button type="button" class="chart-act" @click="$emit('edge', { edge: 'to', at_s: at })">To here</button>
      </div>
      <p class="replay-source" role="status">{{ problem || sentence }}</p>
    </div>`,
  props: { address: String, duration: Number, start: Number, hand: Number, chart: Number },
  data: () => ({ at: 0, plays: false, speed: 1, speeds: SPEEDS, sentence: "", problem: "" }),
  computed: { clock() { return `${this.at.toFixed(2)} of ${this.duration.toFixed(2)} s`; } },
  created() {
    this.parts = [];
    this.asked = new Map();
  },
  mounted() { this.$nextTick(() => this.seek(this.start)); },
  beforeUnmount() {
    this.gone = true;
    cancelAnimationFrame(this.next);
  },
  methods: {
    seek(at) {
      this.plays = false;
      this.go(at);
    },
    /** The hand and the cursor at `at`; true once that part is here. */
    go(at) {
      this.at = Math.min(this.duration, Math.max(0, at));
      getElement(this.chart)?.cursor(this.at);
      const part = this.part(this.at);
      if (part) this.pose(part);
      return Boolean(part);
    },
    /** What holds a moment; it is asked for where it is not here. Parts are equally long. */
    part(at) {
      const known = this.parts.find((one) => at >= one.from_s && (at < one.to_s || one.to_s >= this.duration));
      if (!known) this.fetch(this.length ? Math.floor(at / this.length) * this.length : 0);
      return known;
    },
    async fetch(from) {
      if (this.asked.has(from)) return;
      this.asked.set(from, true);
      const url = new URL(this.address, location.href);
      url.searchParams.set("from_s", from);
      try {
        const answer = await fetch(url);
        const found = await answer.json();
        if (this.gone) return;
        if (!answer.ok) throw new Error(found.detail);
        this.length ??= found.to_s - found.from_s;
        this.sentence = found.sentence;
        this.problem = "";
        this.parts = [...this.parts.slice(1 - KEPT), found];
        this.go(this.at);
      } catch (error) {
        this.plays = false;
        this.problem = error instanceof TypeError ? "The service does not answer: try Play again." : error.message;
      } finally {
        this.asked.delete(from);
      }
    },
    pose(part) {
      const hand = getElement(this.hand), times = part.time_s;
      let low = 0, high = times.length; // the last frame at or before the moment
      while (high - low > 1) {
        const middle = (low + high) >> 1;
        if (times[middle] <= this.at + 1e-6) low = middle; else high = middle;
      }
      const values = part.values[low];
      const named = (of) => Object.fromEntries(part.names.map((name, i) => [name, of[i]]));
      if (part.source === "raw") { if (values) hand.showReadings(named(values), named(part.spans)); }
      else hand.show(values?.some((one) => one !== null) ? named(values) : null);
    },
    again() { this.since = null; },
    toggle() {
      this.plays = !this.plays;
      if (!this.plays) return;
      if (this.at >= this.duration) this.go(0);
      this.again();
      const step = (now) => {
        if (!this.plays || this.gone) return;
        if (this.since === null) [this.since, this.from] = [now, this.at];
        const here = this.go(this.from + this.speed * (now - this.since) / 1000);
        if (!here) this.again(); // it waits for the part
        else if (this.length) {
          const ahead = Math.min(this.duration, this.at + this.speed * AHEAD_S);
          this.part(ahead);
        }
        if (this.at >= this.duration) this.plays = false;
        else this.next = requestAnimationFrame(step);
      };
      this.next = requestAnimationFrame(step);
    },
  },
};
