// The pictures of a take's video, and on a hand's view the pose of the same moment.
export default {
  template: `
    <div class="replay video-beside" v-show="pictures">
      <img v-if="pictures" class="video-picture" :src="address" :alt="'Picture at ' + clock">
      <div class="replay-row">
        <button type="button" class="chart-act" @click="toggle">{{ plays ? "Pause" : "Play" }}</button>
        <button type="button" class="chart-act" aria-label="One picture back" @click="step(-1)">◀</button>
        <button type="button" class="chart-act" aria-label="One picture on" @click="step(1)">▶</button>
        <input type="range" class="replay-slider" min="0" :max="last" :value="picture" @input="seek"
               aria-label="Moment of the video" :aria-valuetext="clock">
        <span class="replay-clock">{{ clock }}</span>
      </div>
      <p v-if="pictures && !hands.degrees[picture]" class="video-none">No glove frame at this moment.</p>
    </div>`,
  props: { video: Object, hands: Object, hand: Number, root: String },
  data: () => ({ picture: 0, plays: false }),
  computed: {
    pictures() { return this.video && this.hands ? this.video.times_s.length : 0; },
    last() { return Math.max(0, this.pictures - 1); },
    address() { return `${this.root}/videos/${this.video.take}/pictures/${this.picture}`; },
    clock() {
      if (!this.pictures) return "";
      const times = this.video.times_s;
      return `${(times[this.picture] - times[0]).toFixed(2)} s of ${this.video.name}`;
    },
  },
  mounted() { this.$nextTick(() => this.show(this.picture)); },
  beforeUnmount() { clearInterval(this.timer); },
  watch: {
    video(now, before) {
      if (now?.take === before?.take) return;
      this.stop();
      this.show(0);
    },
    hands() { this.show(Math.min(this.picture, this.last)); },
  },
  methods: {
    show(picture) {
      this.picture = picture;
      if (!this.pictures) return;
      const { rotations, degrees } = this.hands;
      const now = degrees[picture];
      const view = getElement(this.hand);
      view?.show(now ? Object.fromEntries(rotations.map((name, i) => [name, now[i]])) : null);
    },
    seek(event) { this.stop(); this.show(Number(event.target.value)); },
    step(by) { this.stop(); this.show(Math.min(this.last, Math.max(0, this.picture + by))); },
    stop() { this.plays = false; clearInterval(this.timer); },
    toggle() {
      if (this.plays) return this.stop();
      this.plays = true;
      if (this.picture === this.last) this.show(0);
      const times = this.video.times_s;
      const begin = performance.now() - 1000 * (times[this.picture] - times[0]);
      this.timer = setInterval(() => {
        const at = times[0] + (performance.now() - begin) / 1000;
        let picture = this.picture;
        while (picture < this.last && times[picture + 1] <= at) picture += 1;
        if (picture !== this.picture) this.show(picture);
        if (picture === this.last) this.stop();
      }, 40);
    },
  },
};
