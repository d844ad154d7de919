// When lines of a file are seen over a slow line: `node tools/viewer/arrival.mjs FILE [megabits a second, 1] [round trip in ms, 40]`;
// build the viewer first. All answers share the line, the page is compressed. Milliseconds from asking for the page to the frame
// with the first lines, with lines of every isovalue, and with all of the file; the least and the median of nine visits, with
// nothing of the page cached and with all of it.
import { readFileSync } from "node:fs";
import { openViewer } from "./browser.mjs";

const [file, megabits = "1", trip = "40"] = process.argv.slice(2), data = readFileSync(file), VISITS = 9;
const { page, address, close } = await openViewer(() => data, { width: 960, height: 600 }, { rate: (Number(megabits) * 1e6) / 8, trip: Number(trip) });
const cdp = await page.context().newCDPSession(page);
await page.addInitScript(() => {
  globalThis.seen = {};
  new MutationObserver(() => requestAnimationFrame(() => {
    const { cells, curves, final } = document.documentElement.dataset, all = document.getElementById("isovalue").length - 1;
    if (Number(cells)) globalThis.seen.lines ??= performance.now();
    if (all > 0 && Number(curves) === all) globalThis.seen.isovalues ??= performance.now();
    if (final === "true") globalThis.seen.whole ??= performance.now();
  })).observe(document, { attributes: true, subtree: true });
});
for (const cached of [false, true]) {
  const visits = [];
  for (let i = 0; i < VISITS; i++) {
    if (!cached) await cdp.send("Network.clearBrowserCache");
    await page.goto("about:blank");
    await page.goto(`${address}#file=${cached}${i}.iso`);
    await page.waitForFunction(() => globalThis.seen.whole, undefined, { timeout: 120000 });
    visits.push(await page.evaluate(() => globalThis.seen));
  }
  const figure = (name) => visits.map((visit) => visit[name]).sort((a, b) => a - b).filter((_, i) => i === 0 || i === VISITS >> 1).map(Math.round).join(" / ");
  console.log(`${cached ? "page cached" : "nothing cached"}: first lines ${figure("lines")}, all isovalues ${figure("isovalues")}, whole file ${figure("whole")} ms`);
}
await close();
