// One picture after another: the next is asked for once the last is there, so that a slow line gets fewer.
const EVERY_MS = 100, AGAIN_MS = 1000;

export default {
  template: `
    <div class="camera-view">
      <div class="camera-frame">
        <img v-show="shown" :src="shown" :alt="label">
        <p v-if="!shown" class="camera-none">No picture yet</p>
      </div>
      <div class="glove-sides" role="group" aria-label="Drawn">
        <button v-for="name in names" type="button" class="glove-act" :aria-pressed="String(layers[name])"
                @click="layers[name] = !layers[name]">{{ words[name] }}</button>
      </div>
    </div>`,
  props: { address: String, label: String, live: Boolean },
  data: () => ({
    shown: "", pictures: 0,
    names: ["picture", "labels", "model"],
    words: { picture: "Picture", labels: "Labels", model: "Model" },
    layers: { picture: true, labels: true, model: true },
  }),
  mounted() { this.ask(); },
  beforeUnmount() { clearTimeout(this.timer); this.gone = true; if (this.shown) URL.revokeObjectURL(this.shown); },
  methods: {
    async ask() {
      let wait = AGAIN_MS;
      if (this.live && !document.hidden) {
        try {
          const layers = this.names.filter(name => this.layers[name]).join(",") || "picture";
          const width = Math.min(960, Math.max(320, Math.round(this.$el.clientWidth * Math.min(2, devicePixelRatio))));
          const answer = await fetch(`${this.address}?layers=${layers}&width=${width}`);
          if (answer.ok) {
            const before = this.shown;
            this.shown = URL.createObjectURL(await answer.blob());
            if (before) URL.revokeObjectURL(before);
            this.pictures += 1;
            wait = EVERY_MS;
          }
        } catch { /* the service is away; it is asked again */ }
      }
      if (!this.gone) this.timer = setTimeout(() => this.ask(), wait);
    },
  },
};
