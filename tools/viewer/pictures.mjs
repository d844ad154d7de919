// Pictures of the viewer for the gallery: `node tools/viewer/pictures.mjs` writes docs/viewer-*.png; build the viewer first.
import { join } from "node:path";
import { openViewer, root, samples } from "./browser.mjs";

const made = samples();
const { page, address, close } = await openViewer((name) => made[name], { width: 960, height: 600 });
page.setDefaultNavigationTimeout(120000);
for (const [picture, file] of [["map", "map.iso"], ["one", "map.iso&isovalue=480.5"], ["waves", "waves.iso"], ["surface", "head.iso"],
  ["mesh", "mesh.iso"], ["points", "tin.iso"], ["tiles", "tiles.iso"]]) {
  await page.goto("about:blank");
  await page.goto(`${address}#theme=light&file=${file}`);
  await page.waitForFunction(() => document.documentElement.dataset.final === "true", undefined, { timeout: 120000 });
  await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
  await page.screenshot({ path: join(root, `docs/viewer-${picture}.png`) });
}
await close();
