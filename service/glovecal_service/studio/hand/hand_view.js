// A hand that can be turned: live poses, beside them a translucent one that shows what to do, or two that are compared.
import { Hand, Stage, THREE, TipGaps } from "glovecal-hand";
import { OrbitControls } from "nicegui-scene";

const SURE = new THREE.Color(0x8fa3b8), UNSURE = new THREE.Color(0xc2410c), CHOSEN = 0x1d4ed8;
const UNSURE_DEG = 8; // standard deviation at which a joint has the full colour
const NEARER = 0.8;
const MEASURED = { color: 0x0d9488, roughness: 1, transparent: true, opacity: 0.35, depthWrite: false };
const GHOST = { color: 0x2f6fed, roughness: 0.6, transparent: true };
const RAW = { color: 0x7c3aed, roughness: 0.8, transparent: true, opacity: 0.42, depthWrite: false };
const RAW_THICKNESS = 1.12;
const GHOST_THICKNESS = 1.35; // a shell around the hand where both are in one place
const BESIDE_LIVE = 0.45, ALONE = 0.9; // opacity of what to do
const TO_AND_FRO_S = 2.4, FOLLOWS_S = 0.12;
const GHOST_EVERY_MS = 28, BESIDE_LIVE_MS = 50; // live poses come sooner: one picture shows both
const TAG_AWAY = 16; // px from a joint to its angle
const FEED_FIELDS = 2; // number of rotations, number of sensors

export default {
  template: `
    <div class="hand-view">
      <canvas ref="canvas" tabindex="0" role="img" :aria-label="label" @pointerdown="down" @pointerup="up"
              @keydown="key"></canvas>
      <div ref="tag" class="hand-view-tag" aria-hidden="true" v-show="tagged"></div>
      <div ref="none" class="hand-view-none" v-show="!shows && !ghost?.length && !rawShows">{{ empty }}</div>
    </div>`,
  props: {
    skeleton: Object, feed: String, label: String, empty: String, from: String, ghost: Array,
    raw: Object, // {reads: {rotation: sensor}, least: counts, shown: bool}: an uncalibrated hand beside the live one
    calibrated: { type: Boolean, default: true },
  },
  data: () => ({ shows: false, rawShows: false, tagged: false }),
  mounted() {
    this.stage = new Stage(this.$refs.canvas, OrbitControls, () => this.prepare());
    this.look(this.from);
    if (!this.feed) this.stage.zoom(NEARER); // a comparison is about millimetres
    this.calm = matchMedia("(prefers-reduced-motion: reduce)");
    this.hand = null;
    this.chosen = null;
    this.updates = 0;
    this.spans = new Map(); // of each sensor's readings so far: [least, greatest]
    this.build();
    if (this.feed) this.listen();
  },
  beforeUnmount() {
    this.gone = true;
    this.socket?.close();
    clearTimeout(this.again);
    clearTimeout(this.later);
    this.clear();
    this.stage.dispose();
  },
  watch: {
    skeleton(now, before) {
      // Another ghost brings all properties anew.
      if (JSON.stringify(now) !== JSON.stringify(before)) this.build();
    },
    ghost() { this.stage.redraw(); },
    raw() { this.showRaw(); },
    calibrated() { this.showHand(); },
  },
  methods: {
    build() {
      this.clear();
      this.hand = new Hand(this.skeleton);
      this.hand.root.visible = false;
      this.stage.scene.add(this.hand.root);
      this.stage.redraw();
    },
    /** Before each picture; a ghost that moves wants another one. */
    prepare() {
      const wait = this.haunt(performance.now() / 1000);
      this.tag();
      clearTimeout(this.later);
      if (wait) this.later = setTimeout(() => this.stage.redraw(), wait);
    },
    /** The ghost goes to what it is to show; between two hands it goes to and fro. In ms, when it has moved on;
        null where it stays. */
    haunt(now) {
      const hands = this.ghost ?? [];
      if (!hands.length) {
        if (this.second) this.second.root.visible = false;
        return null;
      }
      if (!this.second) {
        this.second = new Hand(this.skeleton, GHOST, GHOST_THICKNESS);
        this.second.root.renderOrder = 1;
        this.stage.scene.add(this.second.root);
        this.at = {};
        this.opacity = null;
      }
      const passed = now - (this.haunted ?? 0);
      this.haunted = now;
      const turn = (now % TO_AND_FRO_S) / TO_AND_FRO_S;
      const stays = this.calm.matches; // somebody who does not want motion sees one hand, then the other
      const share = hands.length < 2 ? 0 : stays ? Math.round(turn) : 0.5 - 0.5 * Math.cos(2 * Math.PI * turn);
      const nearer = stays ? 1 : 1 - Math.exp(-Math.min(0.1, passed) / FOLLOWS_S);
      let furthest = this.second.root.visible ? 0 : 1;
      for (const [name, first] of Object.entries(hands[0])) {
        const aim = first + share * ((hands[1] ?? hands[0])[name] - first);
        const from = this.at[name] ?? aim;
        this.at[name] = from + nearer * (aim - from);
        furthest = Math.max(furthest, Math.abs(aim - from));
      }
      // What a step says nothing of, such as the wrist, is as the wearer has it.
      for (const { name, rule } of this.skeleton.rotations) {
        const angle = this.live?.[name];
        if (name in hands[0] || rule !== null || !Number.isFinite(angle)) continue;
        furthest = Math.max(furthest, Math.abs(angle - (this.at[name] ?? 0)));
        this.at[name] = angle;
      }
      const opacity = this.shows ? BESIDE_LIVE : ALONE, isThere = furthest < 0.02 && opacity === this.opacity;
      if (!isThere) {
        this.opacity = opacity;
        this.second.fade(opacity);
        this.second.root.visible = true;
        this.second.pose(this.at);
      }
      if (stays && hands.length > 1) return 1000 * TO_AND_FRO_S * (turn < 0.5 ? 0.5 - turn : 1 - turn);
      if (isThere && hands.length < 2) return null;
      return this.shows ? BESIDE_LIVE_MS : GHOST_EVERY_MS;
    },
    clear() {
      for (const part of [this.hand, this.second, this.measured, this.gaps, this.rawHand]) {
        if (part) this.stage.scene.remove(part.root);
        part?.dispose();
      }
      this.hand = this.second = this.measured = this.gaps = this.rawHand = null;
    },
    /** A hand with `angles`, a translucent one with `others`, and their tips' distances drawn. */
    showBoth(angles, others) {
      if (!this.measured) {
        this.measured = new Hand(this.skeleton, MEASURED, GHOST_THICKNESS);
        this.gaps = new TipGaps();
        this.stage.scene.add(this.measured.root, this.gaps.root);
      }
      this.measured.pose(others);
      this.show(angles);
      this.gaps.draw(this.hand, this.measured);
      this.updates += 1;
    },
    /** `angles` by rotation in degrees, null hides the hand; `deviations` colour the joints. */
    show(angles, deviations) {
      this.shows = angles !== null;
      this.live = angles ?? {};
      this.deviations = deviations ?? {};
      this.showHand();
      if (angles !== null) {
        this.hand.pose(angles);
        this.colour(this.hand, deviations ?? {});
      }
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
    showHand() {
      this.hand.root.visible = this.shows && this.calibrated;
      this.stage.redraw();
    },
    /** Note how far each sensor's readings go; `readings` by sensor. */
    span(readings) {
      for (const [sensor, value] of Object.entries(readings)) {
        const span = this.spans.get(sensor);
        if (!span) this.spans.set(sensor, [value, value]);
        else if (value < span[0]) span[0] = value;
        else if (value > span[1]) span[1] = value;
      }
      this.readings = readings;
      this.showRaw();
    },
    /** Readings of a recording; `spans` are those of all of it. */
    showReadings(readings, spans) {
      this.spans = new Map(Object.entries(spans));
      this.readings = readings;
      this.showRaw();
    },
    /** Angles of a hand whose joints are linear in one sensor each; one that has hardly moved rests. */
    uncalibrated() {
      const angles = {};
      for (const { name, low, high, rule } of this.skeleton.rotations) {
        if (name.startsWith("W_")) { // the wrist is turned as the calibrated one: fingers are compared
          if (Number.isFinite(this.live?.[name])) angles[name] = this.live[name];
          continue;
        }
        const sensor = this.raw.reads[name] ?? name, value = this.readings?.[sensor];
        if (rule !== null || value === undefined) continue;
        const [least, greatest] = this.spans.get(sensor);
        if (greatest - least < this.raw.least) continue;
        angles[name] = low + (high - low) * (value - least) / (greatest - least);
      }
      return angles;
    },
    showRaw() {
      const shows = Boolean(this.raw?.shown && this.readings);
      this.rawShows = shows;
      if (shows) {
        if (!this.rawHand) {
          this.rawHand = new Hand(this.skeleton, RAW, RAW_THICKNESS);
          this.rawHand.root.renderOrder = 1;
          this.stage.scene.add(this.rawHand.root);
        }
        this.rawHand.pose(this.uncalibrated());
      }
      if (this.rawHand) {
        this.rawHand.root.visible = shows;
        this.stage.redraw();
      }
    },
    /** The chosen joint's angle beside it. */
    tag() {
      const [ball] = this.hand?.balls.get(this.chosen) ?? [];
      this.tagged = Boolean(ball) && this.hand.root.visible;
      if (!this.tagged) return;
      this.hand.root.updateMatrixWorld(true);
      const { x, y } = this.stage.seenAt(ball), sd = this.deviations[this.chosen];
      const said = this.live[this.chosen];
      this.$refs.tag.textContent = Number.isFinite(said)
        ? `${this.chosen} ${said.toFixed(1)}° ± ${sd.toFixed(1)}°` : this.chosen;
      const { offsetWidth } = this.$refs.tag, room = this.$refs.canvas.clientWidth - offsetWidth;
      const left = x + TAG_AWAY < room ? x + TAG_AWAY : Math.max(0, x - TAG_AWAY - offsetWidth);
      this.$refs.tag.style.transform = `translate(${left}px, ${y - 12}px)`;
    },
    look(from) { this.stage.look(from, this.skeleton.hand); },
    zoom(factor) { this.stage.zoom(factor); },
    choose(rotation) {
      this.chosen = rotation;
      if (this.hand) this.colour(this.hand, this.deviations ?? {});
      this.stage.redraw();
    },
    /** What the page has drawn, for tests and the bench. */
    drawn() { return { drawn: this.stage.drawn, updates: this.updates }; },
    places() { return this.hand.places(); },
    placesOfRaw() { return this.rawHand?.root.visible ? this.rawHand.places() : null; },
    down(event) { this.pressed = [event.clientX, event.clientY]; },
    up(event) {
      const moved = Math.hypot(event.clientX - this.pressed[0], event.clientY - this.pressed[1]);
      if (moved > 4 || !this.shows) return; // it was a turn
      // Where joints share a place, another click goes on to the next one that has an angle.
      const there = this.stage.picked(event, this.hand).filter((name) => name in this.live);
      const next = there[(there.indexOf(this.chosen) + 1) % there.length];
      if (next) this.$emit("rotation", next);
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
      if (this.raw) {
        const readings = {};
        this.names.sensors.forEach((name, i) => { readings[name] = values[FEED_FIELDS + 2 * rotations + i]; });
        this.span(readings);
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
