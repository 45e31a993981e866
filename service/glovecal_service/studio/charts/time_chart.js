// Measured, predicted and error of one rotation over linked time, for one model or several.
//
// Two plots, one axis: they zoom and move together. The canvas is a picture to who hears the page; series,
// cursors and zoom are plain buttons around it, for mouse and keyboard alike.
import { chart, colours, degrees } from "glovecal-charts";
import { LEAST_S, LEFT, overTime, RIGHT, seriesOf } from "glovecal-charts/over_time.js";

const WAIT_MS = 300; // after the last change, before more is asked for
const CURSORS = ["A", "B"];
const FIRST_APART_S = 1;

export default {
  mixins: [chart],
  template: `
    <div class="time-chart">
      <div class="chart-legend" role="group" aria-label="Series; one click shows one alone, another all of them">
        <button v-for="one in series" :key="one.key" type="button" class="chart-series"
                :aria-pressed="alone === one.key" @click="isolate(one.key)">
          <span class="chart-swatch" :style="{ background: one.colour }" aria-hidden="true"></span>{{ one.label }}
        </button>
      </div>
      <div class="chart-box" ref="box">
        <div ref="plot" class="time-plot" role="img" :aria-label="label"></div>
        <div v-for="name in cursors" :key="name" class="chart-cursor" :class="'chart-cursor-' + name"
             v-show="at[name] !== null" :style="{ left: place[name] + 'px' }">
          <div class="chart-cursor-line" v-show="isInside[name]"></div>
          <button type="button" class="chart-handle" role="slider" :aria-label="'Cursor ' + name"
                  :aria-valuemin="0" :aria-valuemax="length" :aria-valuenow="at[name] ?? 0"
                  :aria-valuetext="told(name)" @keydown="key(name, $event)" @pointerdown="grab(name, $event)"
                  @pointermove="drag(name, $event)" @pointerup="held = null" @pointercancel="held = null"
                  >{{ name }}</button>
        </div>
      </div>
      <div class="chart-acts">
        <div role="group" aria-label="Time shown">
          <button type="button" class="chart-act" @click="zoomBy(0.5)">Zoom in</button>
          <button type="button" class="chart-act" @click="zoomBy(2)">Zoom out</button>
          <button type="button" class="chart-act" @click="moveBy(-0.5)">Earlier</button>
          <button type="button" class="chart-act" @click="moveBy(0.5)">Later</button>
          <button type="button" class="chart-act" @click="zoom(0, length)">All</button>
        </div>
        <div role="group" aria-label="A click into the chart sets">
          <button v-for="name in cursors" :key="name" type="button" class="chart-act"
                  :aria-pressed="placing === name" @click="placing = name">Click sets {{ name }}</button>
        </div>
      </div>
      <div class="table-box" tabindex="0" role="region" aria-label="Values at the cursors">
        <table class="cursor-table">
          <thead><tr><th scope="col">Cursor</th><th scope="col">Take</th><th scope="col">Time</th>
            <th scope="col">Measured</th>
            <template v-for="model in models" :key="model.label">
              <th scope="col">Predicted<span class="of-model" v-if="models.length > 1">{{ model.label }}</span></th>
              <th scope="col">Error<span class="of-model" v-if="models.length > 1">{{ model.label }}</span></th>
            </template></tr></thead>
          <tbody aria-live="polite">
            <tr v-for="row in readings" :key="row.name" :data-cursor="row.name">
              <th scope="row">{{ row.name }}</th><td>{{ row.take }}</td><td>{{ row.time }}</td>
              <td>{{ row.measured }}</td>
              <template v-for="(one, number) in row.models" :key="number">
                <td>{{ one.predicted }}</td><td>{{ one.error }}</td>
              </template>
            </tr>
          </tbody>
        </table>
      </div>
    </div>`,
  data: () => ({
    series: [], models: [], readings: [], cursors: CURSORS, alone: null, placing: "A", length: 0, held: null,
    at: { A: null, B: null }, place: { A: 0, B: 0 }, isInside: { A: false, B: false },
  }),
  created() {
    this.shown = [0, 1];
    this.known = null;
  },
  mounted() {
    this.chart.on("datazoom", () => { this.readZoom(); this.tellWindow(); });
    this.chart.getZr().on("click", (event) => {
      const point = [event.offsetX, event.offsetY];
      if (![0, 1].some((grid) => this.chart.containPixel({ gridIndex: grid }, point))) return;
      this.set(this.placing, this.chart.convertFromPixel({ xAxisIndex: 0 }, event.offsetX));
    });
  },
  beforeUnmount() {
    clearTimeout(this.windowWaits);
    clearTimeout(this.momentWaits);
  },
  methods: {
    /** Answers of REST: {key, rotation, models: [{label, series}]}. The same key keeps zoom and cursors. */
    show() {
      const given = this.document;
      if (!given) return;
      const models = JSON.parse(JSON.stringify(given.models));
      const [first] = models;
      this.takes = first.series.takes;
      this.length = first.series.linked_s;
      this.rotation = given.rotation;
      this.lines = models.map(({ label, series }) => ({
        label,
        takes: series.takes.map((take) => ({
          ...take, linked: take.time_s.map((time) => time - take.start_s + take.linked_s),
        })),
      }));
      this.models = models.map(({ label }) => ({ label }));
      if (given.key !== this.known) {
        this.known = given.key;
        this.alone = null;
        this.shown = [0, this.length];
        const [take] = this.own(given.at_s);
        const end = take ? take.linked_s + take.end_s - take.start_s : this.length;
        this.wanted = { A: given.at_s, B: Math.min(end, given.at_s + FIRST_APART_S) };
      }
      // Among finer points a cursor finds the frame that it was meant for.
      for (const name of CURSORS) this.at[name] = this.nearest(this.wanted[name]);
      this.draw();
      this.read();
    },
    resized() { this.draw(); },
    draw() {
      if (!this.lines) return;
      const shades = colours();
      this.series = seriesOf(this.lines, shades);
      const option = overTime(this, shades, this.chart.getWidth(), (points) => this.tip(points));
      this.chart.setOption(option, { replaceMerge: ["series"] });
      this.$nextTick(() => this.putCursors());
    },
    tip(points) {
      if (!points.length) return "";
      const row = this.reading("", this.nearest(points[0].axisValue));
      const models = row.models.map((one, i) => {
        const of = this.models.length > 1 ? `, ${this.models[i].label}` : "";
        return `predicted ${one.predicted}, error ${one.error}${of}`;
      });
      return [`${row.take}, ${row.time}`, `measured ${row.measured}`, ...models].join("\n");
    },
    isolate(key) {
      this.alone = this.alone === key ? null : key;
      this.draw();
    },
    // Cursors
    /** The nearest moment that is drawn. */
    nearest(linked) {
      let best = null;
      for (const take of this.lines[0].takes) {
        for (const time of take.linked) {
          if (best === null || Math.abs(time - linked) < Math.abs(best - linked)) best = time;
        }
      }
      return best;
    },
    moments() { return this.lines[0].takes.flatMap((take) => take.linked); },
    set(name, linked, isQuiet = false) {
      const at = this.nearest(linked);
      if (at === null) return;
      this.at[name] = at;
      this.wanted[name] = linked;
      if (at < this.shown[0] || at > this.shown[1]) {
        const half = (this.shown[1] - this.shown[0]) / 2;
        this.zoom(at - half, at + half);
      }
      this.putCursors();
      this.read();
      if (name !== "A" || isQuiet) return;
      clearTimeout(this.momentWaits);
      this.momentWaits = setTimeout(() => {
        const [take, own] = this.own(at);
        if (take) this.$emit("moment", { take: take.take, name: take.name, at_s: own });
      }, WAIT_MS);
    },
    key(name, event) {
      const times = this.moments(), here = times.indexOf(this.at[name]);
      const step = event.shiftKey ? 1 : 0;
      const to = {
        ArrowRight: () => (step ? this.at[name] + step : times[Math.min(times.length - 1, here + 1)]),
        ArrowLeft: () => (step ? this.at[name] - step : times[Math.max(0, here - 1)]),
        Home: () => times[0], End: () => times[times.length - 1],
      }[event.key];
      if (!to) return;
      event.preventDefault();
      this.set(name, to());
    },
    grab(name, event) {
      this.held = name;
      event.target.setPointerCapture(event.pointerId);
    },
    drag(name, event) {
      if (this.held !== name) return;
      const x = event.clientX - this.$refs.box.getBoundingClientRect().left;
      this.set(name, this.chart.convertFromPixel({ xAxisIndex: 0 }, x));
    },
    putCursors() {
      const width = this.$refs.box?.clientWidth;
      if (!width || !this.lines) return;
      for (const name of CURSORS) {
        if (this.at[name] === null) continue;
        const x = this.chart.convertToPixel({ xAxisIndex: 0 }, this.at[name]);
        this.place[name] = Math.min(width - RIGHT, Math.max(LEFT, x));
        this.isInside[name] = x >= LEFT - 1 && x <= width - RIGHT + 1;
      }
    },
    /** The take of a linked time, and the take's own clock there. */
    own(linked) {
      const take = this.takes.find((one) => linked >= one.linked_s - 1e-6
        && linked <= one.linked_s + one.end_s - one.start_s + 1e-6);
      return take ? [take, linked - take.linked_s + take.start_s] : [null, null];
    },
    values(linked) {
      return this.lines.map(({ takes }) => {
        let best = null;
        for (const take of takes) {
          take.linked.forEach((time, k) => {
            const away = Math.abs(time - linked);
            if (best === null || away < best.away) {
              best = { away, measured: take.measured_deg[k], predicted: take.predicted_deg[k], error: take.error_deg[k] };
            }
          });
        }
        return best ?? { measured: null, predicted: null, error: null };
      });
    },
    reading(name, linked) {
      const [take, own] = this.own(linked), values = this.values(linked);
      return {
        name, take: take?.name ?? "–", time: take ? `${(own - take.start_s).toFixed(3)} s` : "–",
        measured: degrees(values[0].measured),
        models: values.map((one) => ({ predicted: degrees(one.predicted), error: degrees(one.error, true) })),
      };
    },
    read() {
      if (this.at.A === null) return;
      const [a, b] = CURSORS.map((name) => this.values(this.at[name]));
      const isOne = this.own(this.at.A)[0] === this.own(this.at.B)[0];
      const less = (one, other) => (one === null || other === null ? null : one - other);
      const seconds = this.at.B - this.at.A;
      this.readings = [
        ...CURSORS.map((name) => this.reading(name, this.at[name])),
        {
          name: "B − A", take: isOne ? "" : "two takes", time: isOne ? `${seconds.toFixed(3)} s` : "–",
          measured: degrees(less(b[0].measured, a[0].measured), true),
          models: a.map((one, i) => ({
            predicted: degrees(less(b[i].predicted, one.predicted), true), error: degrees(less(b[i].error, one.error), true),
          })),
        },
      ];
    },
    told(name) {
      const row = this.readings.find((one) => one.name === name);
      return row ? `${row.take}, ${row.time}, measured ${row.measured}` : "";
    },
    // Zoom
    zoom(from, to) {
      const span = Math.max(LEAST_S, Math.min(this.length, to - from));
      const begin = Math.min(Math.max(0, from), this.length - span);
      this.chart.dispatchAction({ type: "dataZoom", startValue: begin, endValue: begin + span });
    },
    zoomBy(factor) {
      const [from, to] = this.shown, middle = (from + to) / 2, half = ((to - from) * factor) / 2;
      this.zoom(middle - half, middle + half);
    },
    moveBy(share) {
      const [from, to] = this.shown, by = (to - from) * share;
      this.zoom(from + by, to + by);
    },
    readZoom() {
      const [zoom] = this.chart.getOption().dataZoom;
      this.shown = [zoom.startValue, zoom.endValue];
      this.$nextTick(() => this.putCursors());
    },
    tellWindow() {
      clearTimeout(this.windowWaits);
      this.windowWaits = setTimeout(
        () => this.$emit("window", { from_s: this.shown[0], to_s: this.shown[1] }), WAIT_MS,
      );
    },
    /** Both cursors on a stretch of linked time, and a little more around it. */
    showStretch(from, to) {
      const around = Math.max(1, to - from);
      this.zoom(from - around, to + around);
      this.set("A", from, true);
      this.set("B", to, true);
    },
    /** For tests: what is drawn. */
    state() {
      const drawn = this.chart.getOption().series.filter((one) => one.type === "line" && one.data.length);
      return { shown: this.shown, series: drawn.map((one) => one.name), at: { ...this.at } };
    },
  },
};
