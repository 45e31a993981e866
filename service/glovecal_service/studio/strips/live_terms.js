// What one live angle is made of: base, each effect, sum, each with its standard deviation.
const LEAST_SCALE_DEG = 5; // what half of a bar is, at least

export default {
  template: `
    <section class="live-terms" v-if="rotation" :aria-label="label">
      <div class="live-terms-head">
        <h3 class="studio-subheading">{{ rotation }}, term by term</h3>
        <button type="button" class="live-terms-close" @click="$emit('close')">Close</button>
      </div>
      <table class="live-terms-table" v-if="angle" :class="{ 'live-terms-plain': !rows.some((row) => row.bar) }" :data-sequence="answer.sequence">
        <thead><tr>
          <th scope="col">Term</th><td class="live-terms-bar"></td><th scope="col">Degrees</th><th scope="col">SD</th>
        </tr></thead>
        <tbody>
          <tr v-for="row in rows" :key="row.key" :class="{ 'live-terms-sum': row.isSum }">
            <th scope="row">{{ row.name }}</th>
            <td class="live-terms-bar"><span v-if="row.bar" :style="row.bar"></span></td>
            <td>{{ row.degrees }}</td><td>{{ row.sd }}</td>
          </tr>
        </tbody>
      </table>
      <p v-if="problem" class="live-terms-problem" role="status">{{ problem }}</p>
      <p v-for="sentence in sentences" :key="sentence">{{ sentence }}</p>
      <p v-if="angle" class="live-terms-of">{{ source }}</p>
    </section>`,
  props: { label: String },
  data: () => ({ rotation: null, answer: null, problem: "", scale: LEAST_SCALE_DEG }),
  computed: {
    angle() { return this.answer?.rotations[0] ?? null; },
    rows() {
      const { terms, degrees, sd_deg: sd } = this.angle;
      const rows = terms.map(({ name, kind, degrees: value, sd_deg: own, variance_deg2: variance }, i) => {
        const moves = kind !== "noise" && kind !== "interval";
        const added = i > 0 && moves;
        return {
          key: `${i} ${name}`, name, isSum: false,
          degrees: !moves ? "" : added ? `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(2)}°` : `${value.toFixed(2)}°`,
          sd: own !== null ? `${own.toFixed(2)}°` : variance === null ? "not stored" : "less noise",
          bar: added ? this.bar(value) : null,
        };
      });
      return [...rows, {
        key: "sum", name: "served angle", isSum: true, degrees: `${degrees.toFixed(2)}°`, sd: `${sd.toFixed(2)}°`, bar: null,
      }];
    },
    sentences() { return this.angle ? [...this.answer.sentences, ...this.angle.sentences] : []; },
    source() {
      const readings = Object.entries(this.angle.readings).map(([name, value]) => `${name} ${value.toFixed(0)}`);
      const from = readings.length ? ` Readings: ${readings.join(", ")}.` : "";
      return `Frame ${this.answer.sequence}, model ${this.answer.model.slice(0, 12)}.${from}`;
    },
  },
  methods: {
    /** Begin with another rotation; null ends. */
    begin(rotation) {
      Object.assign(this, { rotation, answer: null, problem: rotation ? "Asking the service ..." : "", scale: LEAST_SCALE_DEG });
    },
    show(answer) {
      if (answer.rotations[0]?.rotation !== this.rotation) return;
      for (const { kind, degrees } of answer.rotations[0].terms) {
        // It only grows: a scale that breathes cannot be read.
        if (kind === "held" || kind === "correction") this.scale = Math.max(this.scale, Math.abs(degrees));
      }
      this.answer = answer;
      this.problem = "";
    },
    /** Nothing new can be explained now; what was, is old. */
    refuse(problem) {
      this.answer = null;
      this.problem = problem;
    },
    bar(value) {
      const share = 50 * Math.min(1, Math.abs(value) / this.scale);
      return { left: `${value < 0 ? 50 - share : 50}%`, width: `${share}%` };
    },
  },
};
