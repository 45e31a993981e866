// Every rotation's angle and standard deviation now; a button each, so that a joint can be chosen by keyboard.
export default {
  template: `
    <ul class="angles" :aria-label="label">
      <li v-for="name in names" :key="name">
        <button type="button" class="angle" :aria-pressed="name === chosen" @click="choose(name)">
          <span>{{ name }}</span><span :ref="(element) => keep(name, element)" class="angle-value">–</span>
        </button>
      </li>
    </ul>`,
  props: { feed: String, label: String },
  data: () => ({ names: [], chosen: null }),
  created() { this.values = {}; this.shownAt = 0; },
  mounted() {
    this.hear = ({ detail }) => {
      if (detail.feed !== this.feed || detail.time - this.shownAt < 150) return; // numbers faster are not read
      this.shownAt = detail.time;
      const names = detail.rotations ? detail.names.rotations : [];
      if (names.join() !== this.names.join()) this.names = names;
      names.forEach((name, i) => {
        const element = this.values[name];
        if (element) element.textContent = `${detail.angles[i].toFixed(1)}° ± ${detail.deviations[i].toFixed(1)}°`;
      });
    };
    window.addEventListener("glovecal-frame", this.hear);
  },
  beforeUnmount() { window.removeEventListener("glovecal-frame", this.hear); },
  methods: {
    keep(name, element) { if (element) this.values[name] = element; else delete this.values[name]; },
    choose(name) {
      this.chosen = this.chosen === name ? null : name;
      this.$emit("rotation", this.chosen);
    },
  },
};
