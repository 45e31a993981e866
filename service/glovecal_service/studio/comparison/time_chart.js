// Measured, predicted and error of one rotation over linked time, for one model or several.
//
// Two plots, one axis: they zoom and move together. The canvas is a picture to who hears the page; series,
// cursors and zoom are plain buttons around it, for mouse and keyboard alike.
import { echarts } from "nicegui-echart";
import { axis, colours, degrees, whenThemeChanges } from "glovecal-comparison";

const LEFT = 64, RIGHT = 18; // of both plots, px
const TOP = { top: 50, height: 190 }, BELOW = { top: 276, height: 96 };
const WAIT_MS = 300; // after the last change, before more is asked for
const LEAST_S = 0.2; // nothing shorter is shown
const CURSORS = ["A", "B"];
const FIRST_APART_S = 1;

export default {
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
  props: { document: Object, label: String },
  data: () => ({
    series: [], models: [], readings: [], cursors: CURSORS, alone: null, placing: "A", length: 0, held: null,
    at: { A: null, B: null }, place: { A: 0, B: 0 }, isInside: { A: false, B: false },
  }),
  mounted() {
    this.chart = echarts.init(this.$refs.plot, null, { renderer: "canvas" });
    this.shown = [0, 1];
    this.known = null;
    this.chart.on("datazoom", () => { this.readZoom(); this.tellWindow(); });
    this.chart.getZr().on("click", (event) => {
      const point = [event.offsetX, event.offsetY];
      if (![0, 1].some((grid) => this.chart.containPixel({ gridIndex: grid }, point))) return;
      this.set(this.placing, this.chart.convertFromPixel({ xAxisIndex: 0 }, event.offsetX));
    });
    this.sizes = new ResizeObserver(() => { this.chart.resize(); this.putCursors(); });
    this.sizes.observe(this.$refs.plot);
    this.endTheme = whenThemeChanges(() => this.draw());
    this.take(this.document);
  },
  beforeUnmount() {
    clearTimeout(this.windowWaits);
    clearTimeout(this.momentWaits);
    this.sizes.disconnect();
    this.endTheme();
    this.chart.dispose();
  },
  watch: { document(given) { this.take(given); } },
  methods: {
    /** Answers of REST: {key, rotation, models: [{label, series}]}. The same key keeps zoom and cursors. */
    take(given) {
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
    keyed() {
      const shades = colours(), several = this.lines.length > 1;
      const of = (what, line) => (several ? `${what}, ${line.label}` : what);
      return [
        { key: "measured", label: "Measured", colour: shades.ink },
        ...this.lines.map((line, i) => ({
          key: `predicted ${i}`, label: `${of("Predicted", line)} ± 1 SD`, colour: shades.model(i),
        })),
        ...this.lines.map((line, i) => ({ key: `error ${i}`, label: of("Error", line), colour: shades.model(i) })),
      ];
    },
    draw() {
      if (!this.lines) return;
      const shades = colours();
      this.series = this.keyed();
      const shows = (key) => this.alone === null || this.alone === key;
      const drawn = [];
      const line = (key, grid, colour, value, more) => drawn.push({
        type: "line", name: key, xAxisIndex: grid, yAxisIndex: grid, showSymbol: false, silent: true,
        animation: false, z: 3, lineStyle: { color: colour, width: 1.6 }, itemStyle: { color: colour },
        data: shows(key) ? value : [], ...more,
      });
      const joined = (takes, name) => takes.flatMap((take) => [
        ...take.linked.map((time, i) => [time, take[name][i]]), [take.linked[take.linked.length - 1] ?? 0, null],
      ]);
      this.lines.forEach(({ takes }, i) => {
        const colour = shades.model(i);
        if (shows(`predicted ${i}`)) drawn.push(this.band(takes, 0, colour, (take, k) => take.predicted_deg[k]));
        if (shows(`error ${i}`)) drawn.push(this.band(takes, 1, colour, () => 0));
        line(`predicted ${i}`, 0, colour, joined(takes, "predicted_deg"));
        line(`error ${i}`, 1, colour, joined(takes, "error_deg"));
      });
      line("measured", 0, shades.ink, joined(this.lines[0].takes, "measured_deg"), {
        z: 4, lineStyle: { color: shades.ink, width: 1.6, type: [5, 3] },
      });
      drawn.push(this.bounds(shades, 0), this.bounds(shades, 1));
      this.chart.setOption({
        animation: false,
        textStyle: { color: shades.ink },
        grid: [{ left: LEFT, right: RIGHT, ...TOP }, { left: LEFT, right: RIGHT, ...BELOW }],
        axisPointer: { link: [{ xAxisIndex: "all" }], lineStyle: { color: shades.quiet } },
        tooltip: {
          trigger: "axis", renderMode: "richText", backgroundColor: shades.card, borderColor: shades.line,
          textStyle: { color: shades.ink }, confine: true, formatter: (points) => this.tip(points),
        },
        xAxis: [0, 1].map((grid) => axis(shades, {
          gridIndex: grid, min: 0, max: this.length, splitLine: { show: false },
          axisLabel: {
            show: grid === 1, color: shades.ink, showMinLabel: false, showMaxLabel: false, hideOverlap: true,
            formatter: "{value} s",
          },
        })),
        yAxis: [
          axis(shades, { gridIndex: 0, scale: true, name: `${this.rotation}, degrees`, nameLocation: "middle", nameGap: 44 }),
          axis(shades, { gridIndex: 1, name: "error, degrees", nameLocation: "middle", nameGap: 44, splitNumber: 3 }),
        ],
        dataZoom: [
          {
            type: "inside", xAxisIndex: [0, 1], filterMode: "none", startValue: this.shown[0], endValue: this.shown[1],
            minValueSpan: LEAST_S, zoomOnMouseWheel: "ctrl", preventDefaultMouseMove: false,
          },
          {
            type: "slider", xAxisIndex: [0, 1], filterMode: "none", bottom: 6, height: 26, left: LEFT, right: RIGHT,
            startValue: this.shown[0], endValue: this.shown[1], minValueSpan: LEAST_S, brushSelect: false,
            showDetail: false, borderColor: shades.line, textStyle: { color: shades.ink },
          },
        ],
        series: drawn,
      }, { replaceMerge: ["series"] });
      this.$nextTick(() => this.putCursors());
    },
    /** One standard deviation on either side of `middle`, as one shape a take and run without a gap. */
    band(takes, grid, colour, middle) {
      const shapes = [];
      for (const take of takes) {
        let run = [];
        take.linked.forEach((time, k) => {
          const centre = middle(take, k), sd = take.sd_deg[k];
          if (centre === null || sd === null) {
            if (run.length > 1) shapes.push(run);
            run = [];
          } else run.push([time, centre, sd]);
        });
        if (run.length > 1) shapes.push(run);
      }
      return {
        type: "custom", xAxisIndex: grid, yAxisIndex: grid, silent: true, animation: false, clip: true, z: 1,
        tooltip: { show: false }, encode: { x: [0, 1], y: [2, 3] },
        data: shapes.map((run) => [
          run[0][0], run[run.length - 1][0],
          Math.min(...run.map(([, centre, sd]) => centre - sd)), Math.max(...run.map(([, centre, sd]) => centre + sd)),
        ]),
        renderItem: (params, api) => {
          const run = shapes[params.dataIndex];
          const up = run.map(([time, centre, sd]) => api.coord([time, centre + sd]));
          const down = run.map(([time, centre, sd]) => api.coord([time, centre - sd])).reverse();
          return { type: "polygon", shape: { points: [...up, ...down] }, style: { fill: colour, opacity: 0.2 } };
        },
      };
    },
    /** Where takes begin and end, with their names. */
    bounds(shades, grid) {
      return {
        type: "line", xAxisIndex: grid, yAxisIndex: grid, data: [], silent: true,
        markArea: {
          silent: true,
          label: { show: grid === 0, color: shades.ink, position: "insideTop", fontSize: 12 },
          data: this.takes.map((take, i) => [
            {
              name: take.name + (take.trained_on ? " (trained on)" : ""), xAxis: take.linked_s,
              itemStyle: { color: shades.quiet, opacity: i % 2 ? 0.12 : 0.05 },
            },
            { xAxis: take.linked_s + take.end_s - take.start_s },
          ]),
        },
        markLine: grid ? {
          silent: true, symbol: "none", label: { show: false }, data: [{ yAxis: 0 }],
          lineStyle: { color: shades.quiet, type: "solid" },
        } : undefined,
      };
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
