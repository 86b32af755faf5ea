// SPDX-License-Identifier: BSD-3-Clause
// node check.js <replay.html> [<least motion, m>]: opens it in Chromium as a double click does, without a network.
const assert = require("assert");
const fs = require("fs");
const path = require("path");
const { pathToFileURL } = require("url");
const { open } = require("./page.js");

// What is drawn, and what the page knows, `share` of the way through the slider.
async function look(page, share) {
  const slider = page.locator("#slider");
  const [least, most] = await slider.evaluate((s) => [Number(s.min), Number(s.max)]);
  const time = least + share * (most - least);
  await slider.fill(String(time));
  return page.evaluate((wanted) => {
    const column = window.replay.columns[0];
    const worlds = [];
    for (const { shape, object } of column.view.parts || []) {
      if (!shape.frame || shape.shape === "path" || shape.shape === "bone" || !object.visible) continue;
      const pose = column.run.pose(shape.frame, window.replay.time);
      const off = Math.hypot(...pose.p.map((x, k) => x - object.position.getComponent(k)));
      worlds.push({ frame: shape.frame, p: pose.p, off });
    }
    return {
      wanted, time: window.replay.time, worlds,
      picture: column.view.renderer ? column.view.renderer.domElement.toDataURL() : "",
      plot: column.plots[0].canvas.toDataURL(),
      numbers: [...document.querySelectorAll(".plot b")].map((b) => b.textContent).join(" "),
      clock: document.getElementById("clock").textContent,
    };
  }, time);
}
const moved = (a, b) => Math.max(...a.worlds.map((w, i) => Math.hypot(...w.p.map((x, k) => x - b.worlds[i].p[k]))));

async function main() {
  const file = path.resolve(process.argv[2]);
  const bytes = fs.statSync(file).size;
  assert(bytes < 5e6, `${bytes} bytes`);
  const { browser, context, page, errors, requests } = await open(pathToFileURL(file).href, { width: 1200, height: 800 });
  await context.setOffline(true);

  const runs = await page.evaluate(() => window.replay.runs.length);
  const first = await look(page, 0.02), middle = await look(page, 0.5), again = await look(page, 0.02);
  for (const seen of [first, middle, again]) {
    // The slider keeps 15 digits.
    assert(Math.abs(seen.time - seen.wanted) < 1e-9, `the slider stands at ${seen.wanted}, the page at ${seen.time}`);
    assert(seen.worlds.length > 0 && seen.worlds.every((w) => w.off < 1e-9), "a shape is not at its frame");
  }
  assert(moved(first, middle) > Number(process.argv[3] || 0.05), `nothing moves but ${moved(first, middle)} m`);
  assert(moved(first, again) === 0);
  assert(first.picture.length > 10000, "the 3-D picture is empty");
  for (const what of ["picture", "plot", "numbers", "clock"]) {
    assert.notStrictEqual(first[what], middle[what], `${what} stands still`);
    assert.strictEqual(first[what], again[what], `${what} is not the same again`);
  }
  // Why the robots move as they do, in words that change.
  const reasons = () => page.locator(".why").allTextContents();
  await look(page, 0.02);
  const early = await reasons();
  await look(page, 0.5);
  const late = await reasons();
  assert(early.length > 0 && early.every((words) => words.length > 20), `no reasons: ${early}`);
  assert.notDeepStrictEqual(early, late, "the reasons stand still");
  await look(page, 0.02);
  // A drag turns all pictures.
  const view = await page.locator(".view").first().boundingBox();
  await page.mouse.move(view.x + 200, view.y + 200);
  await page.mouse.down();
  await page.mouse.move(view.x + 300, view.y + 220, { steps: 3 });
  await page.mouse.up();
  assert.notStrictEqual((await look(page, 0.02)).picture, first.picture, "a drag turns nothing");
  // It plays.
  await page.locator("#play").click();
  await page.waitForFunction((t) => window.replay.time > t + 0.2, first.time, { timeout: 30000 });
  await page.locator("#play").click();
  // Buttons show and hide runs.
  if (runs > 1) {
    const count = () => page.locator(".run").count();
    assert.strictEqual(await count(), 2);
    const phase = await page.locator(".phase").first().textContent();
    assert(phase.length > 0, "no phase");
    // Of two runs the first one goes and comes; of more it is one that is not shown.
    await page.locator("#runs label").first().click();
    assert.strictEqual(await count(), runs > 2 ? 3 : 1);
    if (runs === 2) await page.locator("#runs label").first().click();
    assert.strictEqual(await count(), runs > 2 ? 3 : 2);
    for (let i = 1; runs > 2 && i < runs; ++i) await page.locator("#runs label").nth(i).click();
    await look(page, 0.7);
  }
  assert.deepStrictEqual(errors, []);
  assert.deepStrictEqual(requests, [pathToFileURL(file).href], "the page asked for something");
  await browser.close();

  // Without three.js it says so, and all else works.
  const html = fs.readFileSync(file, "utf8");
  const begin = html.indexOf("<script>") + 8, end = html.indexOf("</script>", begin);
  const bare = path.join(path.dirname(file), "replay_without_three.html");
  fs.writeFileSync(bare, html.slice(0, begin) + html.slice(end));
  const without = await open(pathToFileURL(bare).href);
  assert.match(await without.page.locator(".missing").first().textContent(), /three\.js was not found/);
  const a = await look(without.page, 0.02), b = await look(without.page, 0.5);
  assert.notStrictEqual(a.numbers, b.numbers);
  assert.deepStrictEqual(without.errors, []);
  await without.browser.close();
  console.log(`${path.basename(path.dirname(file))}: ${(bytes / 1e6).toFixed(1)} MB, ${runs} runs`);
}
main().catch((error) => {
  console.error(`WRONG: ${error.stack}`);
  process.exit(1);
});
