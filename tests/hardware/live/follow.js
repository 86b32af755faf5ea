// SPDX-License-Identifier: BSD-3-Clause
// node follow.js <url>: Chromium looks at a running loop; prints ALL WELL, or what is wrong.
const assert = require("assert");
const { open } = require("../replay/page.js");

(async () => {
  const { browser, page, errors } = await open(process.argv[2]);
  const state = () => page.evaluate(() => ({
    time: window.replay.time, samples: window.replay.runs[0].times.length,
    events: window.replay.runs[0].texts.length,
    tool: window.replay.runs[0].pose("frame/tool", window.replay.time)?.p,
  }));
  await page.waitForFunction(() => window.replay.runs[0].times.length > 100, null, { timeout: 60000 });
  const first = await state();
  await page.waitForFunction((t) => window.replay.time > t + 1, first.time, { timeout: 30000 });
  const second = await state();
  assert(second.samples > first.samples + 20, "no more frames came");
  assert(second.events > 0, "no text came");
  assert(Math.hypot(...second.tool.map((x, k) => x - first.tool[k])) > 1e-3, "the tool stands still");
  // Who moves the slider looks at what was, while frames come.
  await page.locator("#slider").fill(String(first.time));
  const before = await state();
  await page.waitForFunction((n) => window.replay.runs[0].times.length > n + 20, before.samples);
  assert(Math.abs((await state()).time - before.time) < 0.01, "the slider runs away");
  if (process.argv[3]) await page.screenshot({ path: process.argv[3] });
  await browser.close();
  assert.deepStrictEqual(errors, []);
  console.log("ALL WELL");
})().catch((error) => {
  console.log(`WRONG: ${error.message}`);
  process.exit(1);
});
