// The error of a rotation over what shows an effect: frames, means, how far chance takes a mean, the noise floor.
// What a model with the effect leaves stands beside it, dashed.
import { axis, colours, tooltip, withLegend } from "glovecal-charts";

const MOST_ROOM = 1.25; // of the largest mean: single frames beyond that are cut off

export default {
  mixins: [withLegend("effect-plot")],
  methods: {
    draw() {
      if (!this.document) return;
      const { before, after } = JSON.parse(JSON.stringify(this.document)), shades = colours();
      const hasPlaces = before.categories.length > 0, isSize = before.value.includes("RMSE");
      const series = [], legend = [];
      const dense = before.series.some((one) => one.at.length > 30);
      before.series.forEach((one, number) => {
        if (!one.points_at.length) return;
        series.push({
          type: "scatter", data: one.points_at.map((at, i) => [at, one.points_deg[i]]), silent: true, z: 1,
          symbolSize: hasPlaces ? 9 : 3, symbol: hasPlaces ? "diamond" : "circle",
          itemStyle: { color: before.series.length > 1 ? shades.model(number) : shades.quiet, opacity: hasPlaces ? 0.9 : 0.3 },
        });
      });
      if (before.series.some((one) => one.points_at.length))
        legend.push({ name: hasPlaces ? "mean of a take" : "single frames", kind: hasPlaces ? "diamond" : "dot", colour: shades.quiet });
      const whiskers = (one, colour, low, high) => ({
        type: "custom", silent: true, z: 3, encode: { x: 0, y: [1, 2] },
        data: one.at.flatMap((at, i) => (low(i) === null ? [] : [[at, low(i), high(i)]])),
        renderItem: (params, api) => {
          const [x, bottom] = api.coord([api.value(0), api.value(1)]), top = api.coord([api.value(0), api.value(2)])[1];
          const line = (x1, y1, x2, y2) => ({ type: "line", shape: { x1, y1, x2, y2 }, style: { stroke: colour, lineWidth: 1.5 } });
          return { type: "group", children: [line(x, bottom, x, top), line(x - 4, bottom, x + 4, bottom), line(x - 4, top, x + 4, top)] };
        },
      });
      const addLines = (given, isAfter) => given.series.forEach((one, number) => {
        const colour = shades.model(isAfter && given.series.length === 1 ? 2 : number);
        const name = `${one.name || (hasPlaces ? `mean of a ${given.axis}` : "mean error")}${isAfter ? ", with the effect" : ""}`;
        legend.push({ name, kind: isAfter ? "dashed" : "line", colour });
        series.push({
          type: "line", name, data: one.at.map((at, i) => [at, one.mean_deg[i]]), z: 4, triggerLineEvent: false,
          symbol: dense || isSize ? "none" : isAfter ? "emptyCircle" : "circle", symbolSize: 8,
          lineStyle: { color: colour, width: isSize && number ? 1 : 2.5, type: isAfter ? "dashed" : "solid", opacity: isSize && number ? 0.6 : 1 },
          itemStyle: { color: colour },
        });
        if (isAfter) return;
        if (hasPlaces) series.push(whiskers(one, colour, (i) => one.low_deg[i], (i) => one.high_deg[i]));
        else if (one.chance_deg.some((value) => value !== null))
          series.push(whiskers(one, colour,
            (i) => (one.chance_deg[i] === null ? null : one.mean_deg[i] - one.chance_deg[i]),
            (i) => one.mean_deg[i] + one.chance_deg[i]));
      });
      addLines(before, false);
      if (after) addLines(after, true);
      if (hasPlaces) legend.push({ name: "from 10 to 90 % of the frames", kind: "whisker", colour: shades.model(0) });
      else if (before.series.some((one) => one.chance_deg.some((value) => value !== null)))
        legend.push({ name: "± what chance reaches (95 %)", kind: "whisker", colour: shades.quiet });
      const floor = before.floor?.floor_deg ?? null;
      if (floor !== null) {
        const name = `noise floor ${isSize ? "" : "± "}${floor.toFixed(2)}°`;
        legend.push({ name, kind: "band", colour: shades.green });
        series.push({
          type: "line", data: [], silent: true, z: 0,
          markArea: { silent: true, itemStyle: { color: shades.green, opacity: 0.22 }, data: [[{ yAxis: isSize ? 0 : -floor }, { yAxis: floor }]] },
        });
      }
      this.legend = legend;
      const means = [...before.series, ...(after?.series ?? [])].flatMap((one) => one.mean_deg.flatMap((mean, i) => {
        const reach = hasPlaces ? [one.low_deg[i], one.high_deg[i]] : [mean - (one.chance_deg[i] ?? 0), mean + (one.chance_deg[i] ?? 0)];
        return mean === null ? [] : [mean, ...reach.filter((value) => value !== null)];
      }));
      const room = MOST_ROOM * Math.max(floor ?? 0, ...means.map(Math.abs)), grain = room > 4 ? 2 : room > 1 ? 0.5 : 0.2, nice = grain * Math.ceil(room / grain);
      const unit = before.unit === "deg" ? "degrees" : before.unit === "deg/s" ? "degrees per second" : before.unit;
      const across = hasPlaces
        ? axis(shades, { type: "category", data: before.categories, name: before.axis })
        : axis(shades, { scale: true, name: `${before.axis}${unit ? `, ${unit}` : ""}`, splitLine: { show: false } });
      this.chart.setOption({
        animation: false, textStyle: { color: shades.ink },
        tooltip: tooltip(shades, {
          formatter: ({ seriesName, value }) => `${seriesName}\n${hasPlaces ? before.categories[value[0]] : `${Number(value[0]).toPrecision(3)} ${unit}`}: ${Number(value[1]).toFixed(2)}°`,
        }),
        grid: { left: 58, right: 16, top: 14, bottom: 46 },
        xAxis: { ...across, nameLocation: "middle", nameGap: 28 },
        yAxis: axis(shades, { name: `${before.value}, degrees`, nameLocation: "middle", nameGap: 38, min: isSize ? 0 : -nice, max: nice }),
        series,
      }, true);
    },
  },
};
