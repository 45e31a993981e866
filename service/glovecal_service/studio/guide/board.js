// What is asked now, in letters that are read from two metres, and how far it is.
import { Tones, listenToKeys } from "glovecal-guide";

const AROUND = 2 * Math.PI * 44; // of the ring
const FULL_AT = 4; // times still

export default {
  template: `
    <section class="board" :data-phase="state.phase" :aria-label="label" tabindex="-1" ref="board">
      <p class="board-note">{{ state.note }}</p>
      <p class="board-ask">{{ state.ask }}</p>
      <p class="board-needs" v-show="state.needs">{{ state.needs }}</p>
      <div class="board-now">
        <svg class="board-ring" viewBox="0 0 100 100" aria-hidden="true" v-show="state.of_s">
          <circle cx="50" cy="50" r="44" class="board-ring-all" />
          <circle cx="50" cy="50" r="44" class="board-ring-left" ref="ring" transform="rotate(-90 50 50)" />
          <text x="50" y="50" class="board-ring-text" ref="seconds"></text>
        </svg>
        <div class="board-words">
          <p class="board-line" aria-live="assertive">{{ state.line }}</p>
          <p class="board-why" v-show="state.why" aria-live="polite">{{ state.why }}</p>
        </div>
      </div>
      <div class="board-still" v-if="state.steadiness !== undefined">
        <div class="board-bar" role="meter" aria-label="Motion of the hand" aria-valuemin="0" :aria-valuemax="most"
             :aria-valuenow="state.steadiness ?? 0" :aria-valuetext="motion" :data-right="right">
          <div class="board-bar-fill" :style="{ width: share + '%' }"></div>
          <div class="board-bar-limit"></div>
        </div>
        <p class="board-motion">{{ motion }}</p>
      </div>
      <div class="board-foot">
        <p class="board-last">{{ state.last }}</p>
        <button type="button" class="board-mute" :aria-pressed="String(muted)" @click="mute">
          {{ muted ? "Sound is off" : "Sound is on" }} <kbd>M</kbd>
        </button>
      </div>
    </section>`,
  props: { state: Object, keys: Object, label: String },
  data: () => ({ muted: false }),
  computed: {
    most() { return FULL_AT * this.state.still; },
    share() { return Math.min(100, (100 * (this.state.steadiness ?? 0)) / this.most); },
    isStill() { return (this.state.steadiness ?? 0) <= this.state.still; },
    right() {
      if (this.state.steadiness === null || !["settling", "recording"].includes(this.state.phase)) return "";
      return String(this.isStill === (this.state.wants === "still"));
    },
    motion() {
      if (this.state.steadiness === null) return "No frames arrive now.";
      const percent = this.state.steadiness.toFixed(1);
      return `${this.isStill ? "Still" : "Moving"}: ${percent} % of a sensor's range (still: below ${this.state.still} %)`;
    },
  },
  mounted() {
    this.tones = new Tones();
    this.muted = this.tones.muted;
    this.heard = this.state.number;
    this.endsAt = 0;
    this.time();
    this.deaf = listenToKeys({ ...this.keys, mute: ["m"] }, (name) => {
      if (name === "mute") this.mute();
      else this.$emit("act", name);
    });
    this.$refs.board.focus({ preventScroll: true });
    if (matchMedia("(max-width: 860px)").matches && this.state.number) this.$refs.board.scrollIntoView();
  },
  beforeUnmount() {
    cancelAnimationFrame(this.next);
    this.deaf();
    this.tones.close();
  },
  watch: {
    state(state) {
      if (state.number !== this.heard) {
        this.heard = state.number;
        this.tones.play(state.tone);
      }
      this.time();
    },
  },
  methods: {
    time() {
      this.endsAt = performance.now() + 1000 * (this.state.left_s ?? 0);
      this.run();
    },
    /** Frames of the browser are asked for only as long as time is counted down. */
    run() {
      cancelAnimationFrame(this.next);
      if (this.state.of_s) this.next = requestAnimationFrame(() => { if (this.draw()) this.run(); });
    },
    mute() {
      this.muted = !this.muted;
      this.tones.mute(this.muted);
    },
    /** Whether time is left. */
    draw() {
      const whole = this.state.of_s;
      const left = Math.max(0, (this.endsAt - performance.now()) / 1000);
      this.$refs.ring.style.strokeDasharray = `${(AROUND * left) / whole} ${AROUND}`;
      const text = String(Math.ceil(left));
      if (this.$refs.seconds.textContent !== text) this.$refs.seconds.textContent = text;
      return left > 0;
    },
    /** Names of the tones so far, for tests. */
    played() { return this.tones.played; },
  },
};
