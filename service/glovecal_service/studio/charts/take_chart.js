// A take over time: one band a sensor with its counts, one a rotation with its degrees, zoomed together; what is
// missing, recorded before it was asked for, left out, or jumps, is shaded. A second take lies over the first. Or
// spectra. A cursor goes with the replay; a click sets it, and a mouse that is drawn over the curves marks a stretch.
import { axis, chart, colours, tooltip } from "glovecal-charts";

const BAND = 92, BELOW = 22, TOP = 34, BOTTOM = 64, LEFT = 108, RIGHT = 26;
const DRAWN_PX = 5; // less is a click

export default {
  mixins: [chart],
  template: `
    <div class="take-box" @pointerdown="down" @pointermove="move" @pointerup="up" @pointercancel="pressed = null">
      <div ref="plot" class="take-plot" role="img" :aria-label="label"></div>
      <div v-show="marked" class="take-marked" :style="marked"></div>
      <div v-show="line" class="take-cursor" :style="line"></div>
    </div>`,
  data: () => ({ at: null, chosen: null, line: null, marked: null }),
  mounted() { this.chart.on("datazoom", () => this.place()); },
  methods: {
    resized() { this.place(); },
    /** Of the replay, seconds. */
    cursor(at) {
      this.at = at;
      this.place();
    },
    choose(from, to) {
      this.chosen = from === null || to === null ? null : [Math.min(from, to), Math.max(from, to)];
      this.place();
    },
    /** Where cursor and stretch are on the page now. */
    place() {
      const width = this.$refs.plot?.clientWidth, isTime = this.document && !this.document.spectra;
      const x = (at) => this.chart.convertToPixel({ xAxisIndex: 0 }, at);
      const inside = (at) => at >= LEFT - 1 && at <= width - RIGHT + 1;
      const box = (from, to) => ({
        left: `${from}px`, width: `${to - from}px`, top: `${TOP}px`, bottom: `${BOTTOM + BELOW}px`,
      });
      this.line = this.marked = null;
      if (!isTime || !width) return;
      if (this.at !== null && inside(x(this.at))) this.line = box(x(this.at) - 1, x(this.at) + 1);
      if (this.chosen) {
        const [from, to] = this.chosen.map((at) => Math.min(width - RIGHT, Math.max(LEFT, x(at))));
        if (to > from) this.marked = box(from, to);
      }
    },
    seconds(event) {
      const { left, width } = this.$refs.plot.getBoundingClientRect();
      const x = Math.min(width - RIGHT, Math.max(LEFT, event.clientX - left));
      const at = this.chart.convertFromPixel({ xAxisIndex: 0 }, x);
      return Math.min(this.document.takes[0].duration_s, Math.max(0, at));
    },
    /** A finger scrolls the page and sets the cursor by a tap; a mouse or pen draws, too. */
    down(event) {
      const { left, top, width, height } = this.$refs.plot.getBoundingClientRect();
      const x = event.clientX - left, y = event.clientY - top;
      if (!this.document || this.document.spectra || event.button) return;
      if (x < LEFT || x > width - RIGHT || y < TOP || y > height - BOTTOM) return;
      this.pressed = { x: event.clientX, at: this.seconds(event) };
    },
    move(event) {
      if (!this.pressed || event.pointerType === "touch") return;
      if (Math.abs(event.clientX - this.pressed.x) < DRAWN_PX && !this.pressed.draws) return;
      this.pressed.draws = true;
      event.currentTarget.setPointerCapture(event.pointerId);
      this.choose(this.pressed.at, this.seconds(event));
    },
    up(event) {
      const pressed = this.pressed;
      this.pressed = null;
      if (pressed?.draws) this.$emit("stretch", this.chosen);
      else if (pressed) this.$emit("moment", this.seconds(event));
    },
    draw() {
      if (!this.document) return;
      const given = JSON.parse(JSON.stringify(this.document)), shades = colours();
      const bands = given.spectra ? this.bands(given, "spectra", "counts") : [
        ...this.bands(given, "readings", "counts"), ...this.bands(given, "reference", "degrees"),
      ];
      const unit = given.spectra ? "Hz" : "s";
      this.$refs.plot.style.height = `${TOP + BOTTOM + BAND * bands.length}px`;
      this.chart.resize();
      const every = bands.map((_, at) => at);
      const shown = `${given.takes.map(each => each.take)} ${given.spectra}`; // zoomed as before, where it is the same
      const zoomed = shown === this.shown ? this.chart.getOption().dataZoom[0] : {};
      const zoom = { start: zoomed.start ?? 0, end: zoomed.end ?? 100 };
      this.shown = shown;
      this.chart.setOption({
        animation: false,
        textStyle: { color: shades.ink },
        legend: { show: given.takes.length > 1, top: 0, textStyle: { color: shades.ink }, data: given.takes.map(each => each.take) },
        tooltip: tooltip(shades, { trigger: "axis", axisPointer: { type: "line" } }),
        axisPointer: { link: [{ xAxisIndex: "all" }] },
        dataZoom: [
          { type: "inside", ...zoom, xAxisIndex: every, zoomOnMouseWheel: "ctrl", moveOnMouseWheel: false, moveOnMouseMove: false, preventDefaultMouseMove: false },
          { type: "slider", ...zoom, xAxisIndex: every, bottom: 8, height: 22, labelFormatter: value => `${value.toFixed(1)} ${unit}` },
        ],
        grid: bands.map((_, at) => ({ left: LEFT, right: RIGHT, top: TOP + at * BAND, height: BAND - BELOW, outerBoundsMode: "none" })),
        xAxis: bands.map((_, at) => axis(shades, {
          gridIndex: at, min: 0, max: "dataMax", splitLine: { show: false }, axisLabel: { show: at === bands.length - 1, color: shades.ink, hideOverlap: true, formatter: value => `${+value.toFixed(2)}` },
          name: at === bands.length - 1 ? unit : "", nameLocation: "end",
        })),
        yAxis: bands.map((band, at) => axis(shades, {
          gridIndex: at, type: given.spectra ? "log" : "value", scale: true, name: band.name, nameLocation: "middle", nameGap: 40, nameRotate: 0, splitNumber: 2,
          nameTextStyle: { color: shades.ink, fontSize: 11, lineHeight: 15, align: "right" },
          axisLabel: { color: shades.ink, hideOverlap: true, formatter: value => `${+value.toPrecision(4)}` },
        })),
        series: bands.flatMap((band, at) => band.lines.map(line => ({
          type: "line", name: line.take, xAxisIndex: at, yAxisIndex: at, data: line.data, showSymbol: false, connectNulls: false,
          lineStyle: { width: 1.2, color: shades.model(line.number) }, itemStyle: { color: shades.model(line.number) },
          markArea: line.number || given.spectra ? undefined : { silent: true, data: this.shaded(given.takes[0], band, shades) },
        }))),
      }, true);
      this.place();
    },
    /** One a name that any of the takes has. */
    bands(given, part, unit) {
      const names = [...new Set(given.takes.flatMap(take => take[part].names))];
      return names.map(name => ({
        name: `${name}\n${unit}`, part, of: name,
        lines: given.takes.flatMap((take, number) => {
          const at = take[part].names.indexOf(name);
          return at < 0 ? [] : [{ take: take.take, number, data: take[part].at.map((x, i) => [x, take[part].values[at][i]]) }];
        }),
      }));
    },
    shaded(take, band, shades) {
      const area = (from, to, colour) => [{ xAxis: from, itemStyle: { color: colour, opacity: 0.25 } }, { xAxis: to }];
      const found = band.part === "readings" ? take.gaps.map(([from, to]) => area(from, to, shades.amber)) : [];
      for (const [from, to] of take.left_out) found.push(area(from, to, shades.ink));
      if (take.pre_roll_s > 0) found.push(area(0, take.pre_roll_s, shades.quiet));
      if (band.part === "reference")
        for (const jump of take.jumps)
          if (jump.rotation === band.of) found.push(area(jump.start_s, jump.comes_back ? jump.end_s : take.duration_s, shades.model(1)));
      return found;
    },
  },
};
