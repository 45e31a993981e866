// Every rotation's angle and standard deviation now; a button each, so that a joint can be chosen by keyboard.
export default {
  template: `
    <div><p class="angles-model" v-show="model">Angles by model <b class="version-id">{{ model }}</b></p>
    <ul class="angles" :aria-label="label">
      <li v-for="name in names" :key="name">
        <button type="button" class="angle" :aria-pressed="name === chosen" @click="choose(name)">
          <span>{{ name }}</span><span :ref="(element) => keep(name, element)" class="angle-value">–</span>
        </button>
      </li>
    </ul></div>`,
  props: { feed: String, label: String },
  data: () => ({ names: [], chosen: null, model: "" }),
  created() { this.values = {}; this.shownAt = 0; },
  mounted() {
    this.hear = ({ detail }) => {
      if (detail.feed !== this.feed) return;
      const model = (detail.rotations ? detail.names.model ?? "" : "").slice(0, 12);
      if (model === this.model && detail.time - this.shownAt < 150) return; // numbers faster are not read
      this.model = model;
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
    /** Chosen elsewhere. */
    mark(name) { this.chosen = name; },
  },
};
