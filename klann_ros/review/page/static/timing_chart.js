'use strict';
/* How regularly the messages of a topic came, and how late: counts over powers of ten. */

// As in timing.py: the first bin is at 10^-6 s, twenty of them to a decade.
const FIRST_DECADE = -6;
const A_DECADE = 20;
const COMPACT = new Intl.NumberFormat('en', { notation: 'compact' });

class TimingCharts {
  constructor(holder, runs) {
    this.holder = holder;
    this.runs = runs;
    this.charts = [];
  }

  show(topic) {
    this.remove();
    this.charts = [
      ['intervals', 'Time between messages'],
      ['latencies', 'Latency: from publishing to receiving'],
    ].map(([key, title]) => this.chart(topic, key, title));
  }

  chart(topic, key, title) {
    const found = this.runs.map((run) => run.topics.find((each) => each.name === topic));
    const histograms = found.map((each) =>
      each ? each[key] : { first: 0, counts: [], text: 'There is none.' },
    );
    return new HistogramChart(this.holder, title, histograms);
  }

  redraw() {
    for (const chart of this.charts) chart.redraw();
  }

  remove() {
    for (const chart of this.charts) chart.remove();
  }
}

class HistogramChart extends DescribedFigure {
  constructor(holder, title, histograms) {
    super(holder, 'card chart', title, histograms.map((each) => each.text).join(' '));
    this.draw(this.options(histograms), table(histograms));
  }

  options(histograms) {
    const colours = ['accent', 'second'];
    return {
      width: this.width(),
      height: HEIGHT,
      padding: [12, 12, 0, 0],
      legend: { show: false },
      cursor: { y: false },
      scales: {
        x: { time: false },
        y: { distr: 3, range: (u, min, max) => [0.5, Math.max(max * 2, 10)] },
      },
      axes: [
        { ...axis('time', 28), splits: decades, values: (u, splits) => splits.map(duration) },
        {
          ...axis('messages', 52, true),
          values: (u, splits) =>
            splits.map((count) => (count === null ? '' : COMPACT.format(count))),
        },
      ],
      series: [
        {},
        ...histograms.map((_, run) => ({
          stroke: () => themeColour(colours[run]),
          fill: () => `${themeColour(colours[run])}40`,
          dash: run ? [4, 3] : [],
          width: 1.5,
          points: { show: false },
          paths: uPlot.paths.stepped({ align: 1 }),
        })),
      ],
    };
  }
}

/** Return the bins of several histograms as columns, with an empty one before and after. */
function table(histograms) {
  const filled = histograms.filter((each) => each.counts.length);
  if (!filled.length)
    return [[FIRST_DECADE, FIRST_DECADE + 1], ...histograms.map(() => [null, null])];
  const first = Math.min(...filled.map((each) => each.first)) - 1;
  const last = Math.max(...filled.map((each) => each.first + each.counts.length));
  const bins = Array.from({ length: last - first + 2 }, (_, i) => first + i);
  return [
    bins.map(exponent),
    ...histograms.map(({ first: begin, counts }) => bins.map((bin) => counts[bin - begin] || 0.5)),
  ];
}

/** Return where the axis of times has labels: at decades, or at 1, 2 and 5 in each of few. */
function decades(u, axisIndex, min, max) {
  const isNarrow = u.bbox.width / devicePixelRatio < 150 * (max - min);
  const steps = isNarrow ? [1] : [1, 2, 5];
  const found = [];
  for (let decade = Math.floor(min); decade <= max; decade += 1) {
    found.push(...steps.map((step) => decade + Math.log10(step)));
  }
  return found.filter((at) => at >= min && at <= max);
}

function exponent(bin) {
  return FIRST_DECADE + bin / A_DECADE;
}

/** Return the time of a power of ten, in the unit that suits it. */
function duration(power10) {
  if (power10 === null) return '';
  const units = [
    [0, 's'],
    [-3, 'ms'],
    [-6, 'µs'],
  ];
  const [zero, unit] = units.find(([from]) => power10 >= from - 1e-9) || units[2];
  return `${Number((10 ** (power10 - zero)).toPrecision(2))} ${unit}`;
}
