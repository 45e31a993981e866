// The error of a rotation against one recorded column: frames, means of bins, and how far chance takes a mean.
import { axis, chart, colours, degrees, tooltip } from "glovecal-charts";

export default {
  mixins: [chart],
  template: `<div ref="plot" class="column-plot" role="img" :aria-label="label"></div>`,
  methods: {
    draw() {
      if (!this.document) return;
      const given = JSON.parse(JSON.stringify(this.document)), shades = colours();
      const unit = given.column.unit ? `, ${given.column.unit}` : "";
      const series = [{
        type: "scatter", name: "frames", data: given.value.map((value, i) => [value, given.error_deg[i]]),
        symbolSize: 3, silent: true, itemStyle: { color: shades.quiet, opacity: 0.35 }, z: 1,
      }];
      const bins = given.dependence;
      if (bins) {
        const middle = bins.mean_deg.map((_, i) => 0.5 * (bins.edges[i] + bins.edges[i + 1]));
        series.push({
          type: "custom", name: "95 % by chance", silent: true, z: 2, itemStyle: { color: shades.model(1) },
          encode: { x: [0, 1], y: [2, 3] },
          data: bins.mean_deg.flatMap((_, i) => (bins.chance_deg[i] === null ? [] : [[
            bins.edges[i], bins.edges[i + 1], given.bias_deg - bins.chance_deg[i], given.bias_deg + bins.chance_deg[i],
          ]])),
          renderItem: (params, api) => {
            const low = api.coord([api.value(0), api.value(2)]), high = api.coord([api.value(1), api.value(3)]);
            const shape = { x: low[0], y: high[1], width: high[0] - low[0], height: low[1] - high[1] };
            return { type: "rect", shape, style: { fill: shades.model(1), opacity: 0.3 } };
          },
        }, {
          type: "line", name: "mean error", data: middle.map((at, i) => [at, bins.mean_deg[i]]), z: 3,
          symbol: "circle", symbolSize: 8, lineStyle: { color: shades.model(0), width: 2 },
          itemStyle: { color: shades.model(0) },
        });
      }
      this.chart.setOption({
        animation: false,
        textStyle: { color: shades.ink },
        legend: { textStyle: { color: shades.ink }, top: 0, selectedMode: false },
        tooltip: tooltip(shades, {
          formatter: ({ dataIndex }) => bins
            ? `${bins.edges[dataIndex].toPrecision(4)} to ${bins.edges[dataIndex + 1].toPrecision(4)}${unit}\n`
              + `mean error ${degrees(bins.mean_deg[dataIndex], true)}, ${bins.count[dataIndex]} frames` : "",
        }),
        grid: { left: 64, right: 18, top: 58, bottom: 48 },
        xAxis: axis(shades, { scale: true, name: `${given.column.name}${unit}`, nameLocation: "middle", nameGap: 28, splitLine: { show: false } }),
        yAxis: axis(shades, { name: "error, degrees", nameLocation: "middle", nameGap: 44 }),
        series,
      }, true);
    },
  },
};
