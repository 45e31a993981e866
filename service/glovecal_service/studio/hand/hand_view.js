// A hand that can be turned and shows live poses.
import { Hand, Stage, THREE } from "glovecal-hand";
import { OrbitControls } from "nicegui-scene";

const SURE = new THREE.Color(0x8fa3b8), UNSURE = new THREE.Color(0xc2410c), CHOSEN = 0x1d4ed8;
const UNSURE_DEG = 8; // standard deviation at which a joint has the full colour
const FEED_FIELDS = 2; // number of rotations, number of sensors

export default {
  template: `
    <div class="hand-view">
      <canvas ref="canvas" tabindex="0" role="img" :aria-label="label" @pointerdown="down" @pointerup="up"
              @keydown="key"></canvas>
      <div ref="none" class="hand-view-none" v-show="!shows">{{ empty }}</div>
    </div>`,
  props: { skeleton: Object, feed: String, label: String, empty: String },
  data: () => ({ shows: false }),
  mounted() {
    this.stage = new Stage(this.$refs.canvas, OrbitControls);
    this.hand = null;
    this.chosen = null;
    this.updates = 0;
    this.build();
    const frame = () => {
      if (this.gone) return;
      this.stage.draw();
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    if (this.feed) this.listen();
  },
  beforeUnmount() {
    this.gone = true;
    this.socket?.close();
    clearTimeout(this.again);
    this.hand?.dispose();
    this.stage.dispose();
  },
  watch: { skeleton() { this.build(); } },
  methods: {
    build() {
      if (this.hand) this.stage.scene.remove(this.hand.root);
      this.hand?.dispose();
      this.hand = new Hand(this.skeleton);
      this.hand.root.visible = false;
      this.stage.scene.add(this.hand.root);
    },
    /** `angles` by rotation in degrees, null hides the hand; `deviations` colour the joints. */
    show(angles, deviations) {
      this.shows = this.hand.root.visible = angles !== null;
      if (angles !== null) {
        this.hand.pose(angles);
        this.colour(this.hand, deviations ?? {});
      }
      this.stage.dirty = true;
    },
    colour(hand, deviations) {
      const mixed = new THREE.Color();
      for (const rotation of hand.balls.keys()) {
        const share = Math.min(1, (deviations[rotation] ?? 0) / UNSURE_DEG);
        mixed.copy(SURE).lerp(UNSURE, share);
        const isChosen = rotation === this.chosen;
        hand.mark(rotation, isChosen ? CHOSEN : mixed.getHex(), isChosen ? 1.5 : 1 + 0.5 * share);
      }
    },
    look(from) { this.stage.look(from); },
    zoom(factor) { this.stage.zoom(factor); },
    choose(rotation) { this.chosen = rotation; },
    /** What the page has drawn, for tests and the bench. */
    drawn() { return { drawn: this.stage.drawn, updates: this.updates }; },
    places() { return this.hand.places(); },
    down(event) { this.at = [event.clientX, event.clientY]; },
    up(event) {
      const moved = Math.hypot(event.clientX - this.at[0], event.clientY - this.at[1]);
      if (moved > 4 || !this.shows) return; // it was a turn
      const rotation = this.stage.picked(event, this.hand);
      if (rotation) this.$emit("rotation", rotation);
    },
    key(event) {
      const act = {
        "1": () => this.look("back"), "2": () => this.look("palm"), "3": () => this.look("side"),
        "+": () => this.zoom(0.85), "-": () => this.zoom(1.18),
      }[event.key];
      if (act) { act(); event.preventDefault(); }
    },
    /** Poses as the service has them: names as text when they change, then one small array a frame. */
    listen() {
      const url = new URL(this.feed, location.href);
      url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
      this.socket = new WebSocket(url);
      this.socket.binaryType = "arraybuffer";
      this.socket.onmessage = ({ data }) => {
        if (typeof data === "string") this.names = JSON.parse(data);
        else this.receive(new Float32Array(data));
      };
      this.socket.onclose = () => {
        if (!this.gone) this.again = setTimeout(() => this.listen(), 1000);
      };
    },
    receive(values) {
      if (!this.names) return;
      const [rotations, sensors] = values;
      const names = this.names.rotations;
      this.updates += 1;
      if (rotations !== names.length || !rotations) {
        this.show(null);
      } else {
        const angles = {}, deviations = {};
        for (let i = 0; i < rotations; i++) {
          angles[names[i]] = values[FEED_FIELDS + i];
          deviations[names[i]] = values[FEED_FIELDS + rotations + i];
        }
        this.show(angles, deviations);
      }
      const from = (start, count) => values.subarray(FEED_FIELDS + start, FEED_FIELDS + start + count);
      window.dispatchEvent(new CustomEvent("glovecal-frame", {
        detail: {
          feed: this.feed, names: this.names, time: performance.now(), rotations,
          angles: from(0, rotations), deviations: from(rotations, rotations), raw: from(2 * rotations, sensors),
        },
      }));
    },
  },
};
