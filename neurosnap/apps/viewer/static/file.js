// Stands in for the server in a page that is one file: unpacks the page's script and all
// answers, and hands these out.

const answers = new Map(); // texts, by what they answer
const json = (question) => JSON.parse(answers.get(question) ?? "null");

// Answers that are made of others.
const MADE = {
  frames({ from, to }) {
    const ticks = Array.from({ length: to - from + 1 }, (_, k) => Number(from) + k);
    return { frames: ticks.map((tick) => json(`frame ${tick}`)).filter(Boolean) };
  },
  graph: ({ tick }) => json(`graph ${json(`frame ${tick}`)?.graph}`),
  edge: ({ source, target, tick }) =>
    json(`edges ${tick}`)?.find((edge) => edge.source === Number(source) && edge.target === Number(target)),
  tested: ({ tick }) => json(`tested ${tick}`),
  difference: ({ tick, then }) => json(`difference ${tick} ${then}`),
  raster({ from, to, sensor }) {
    const all = json(`raster ${sensor}`);
    const [start, stop] = [from - all.first, to - all.first + 1];
    const values = btoa(atob(all.values).slice(start * all.sensors, stop * all.sensors));
    return { ...all, first: Number(from), columns: stop - start, values, done: true };
  },
  beside({ tick }) {
    const { first, anomalies, alarms, times } = json("marks");
    const told = anomalies.flatMap((count, at) => (count + alarms[at] ? [first + at] : []));
    const now = times[tick - first] ?? -Infinity;
    const before = (days) => first + times.findLastIndex((at, k) => k < tick - first && at !== null && at <= now - 86400 * days);
    const [day, week] = [1, 7].map(before).map((one) => (one < first ? null : one));
    return { back: told.findLast((one) => one < tick), on: told.find((one) => one > tick), day, week, done: true };
  },
};

window.recordedImage = (tick) => json(`image ${tick}`);

window.fetch = async (address) => {
  const [name, query] = address.replace("api/", "").split("?");
  const made = MADE[name]?.(Object.fromEntries(new URLSearchParams(query))) ?? json(name);
  if (made) return Response.json(made);
  const error = "this is not in the file; neurosnap view has it";
  return Response.json({ error }, { status: 404 });
};

if ("DecompressionStream" in window) {
  const packed = atob(document.getElementById("packed").textContent);
  const bytes = Uint8Array.from(packed, (letter) => letter.charCodeAt(0));
  const unpacked = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  for (const line of (await new Response(unpacked).text()).split("\n")) {
    const [question, answer] = line.split("\t");
    answers.set(question, answer);
  }
  const script = document.createElement("script");
  script.type = "module";
  script.textContent = json("script");
  document.body.append(script);
} else {
  document.body.textContent =
    "This browser cannot unpack the page: it has no DecompressionStream. Use one of 2023 or later.";
}
