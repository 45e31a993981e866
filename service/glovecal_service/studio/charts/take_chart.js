// A take over time: one band a sensor with its counts, one a rotation with its degrees, zoomed together; what is
// missing, recorded before it was asked for, or jumps, is shaded. A second take lies over the first. Or spectra.
import { axis, chart, colours, tooltip } from "glovecal-charts";

const BAND = 92, TOP = 34, BOTTOM = 64;

export default {
  mixins: [chart],
  template: `<div ref="plot" class="take-plot" role="img" :aria-label="label"></div>`,
  methods: {
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
      this.chart.setOption({
        animation: false,
        textStyle: { color: shades.ink },
        legend: { show: given.takes.length > 1, top: 0, textStyle: { color: shades.ink }, data: given.takes.map(each => each.take) },
        tooltip: tooltip(shades, { trigger: "axis", axisPointer: { type: "line" } }),
        axisPointer: { link: [{ xAxisIndex: "all" }] },
        dataZoom: [
          { type: "inside", xAxisIndex: every, zoomOnMouseWheel: "ctrl", moveOnMouseWheel: false },
          { type: "slider", xAxisIndex: every, bottom: 8, height: 22, labelFormatter: value => `${value.toFixed(1)} ${unit}` },
        ],
        grid: bands.map((_, at) => ({ left: 96, right: 18, top: TOP + at * BAND, height: BAND - 22 })),
        xAxis: bands.map((_, at) => axis(shades, {
          gridIndex: at, min: 0, max: "dataMax", splitLine: { show: false }, axisLabel: { show: at === bands.length - 1, color: shades.ink, hideOverlap: true, formatter: value => `${+value.toFixed(2)}` },
          name: at === bands.length - 1 ? unit : "", nameLocation: "end",
        })),
        yAxis: bands.map((band, at) => axis(shades, {
          gridIndex: at, type: given.spectra ? "log" : "value", scale: true, name: band.name, nameLocation: "middle", nameGap: 44, nameRotate: 0, splitNumber: 2,
          nameTextStyle: { color: shades.ink, lineHeight: 15, align: "right" },
          axisLabel: { color: shades.ink, hideOverlap: true, formatter: value => `${+value.toPrecision(4)}` },
        })),
        series: bands.flatMap((band, at) => band.lines.map(line => ({
          type: "line", name: line.take, xAxisIndex: at, yAxisIndex: at, data: line.data, showSymbol: false, connectNulls: false,
          lineStyle: { width: 1.2, color: shades.model(line.number) }, itemStyle: { color: shades.model(line.number) },
          markArea: line.number || given.spectra ? undefined : { silent: true, data: this.shaded(given.takes[0], band, shades) },
        }))),
      }, true);
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
      if (take.pre_roll_s > 0) found.push(area(0, take.pre_roll_s, shades.quiet));
      if (band.part === "reference")
        for (const jump of take.jumps)
          if (jump.rotation === band.of) found.push(area(jump.start_s, jump.comes_back ? jump.end_s : take.duration_s, shades.model(1)));
      return found;
    },
  },
};
