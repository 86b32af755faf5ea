// SPDX-License-Identifier: BSD-3-Clause
// What the tests of pages share: Chromium of the system, driven by npm's playwright-core.
const { chromium } = require("playwright-core");

// Opens `url`; everything that goes wrong on the page is in `errors`.
async function open(url, size = { width: 1500, height: 1020 }) {
  const browser = await chromium.launch({
    executablePath: process.env.ICAT_CHROMIUM || "/usr/bin/chromium",
    args: ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
      "--ignore-gpu-blocklist"],
  });
  const context = await browser.newContext({ viewport: size });
  const page = await context.newPage();
  const errors = [], requests = [];
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("console", (message) => {
    // The readback of screenshots is slow, which Chromium's driver says.
    if (["error", "warning"].includes(message.type()) && !/GPU stall due to ReadPixels/.test(message.text())) {
      errors.push(message.text());
    }
  });
  page.on("request", (request) => {
    if (!/^(data|blob):/.test(request.url())) requests.push(request.url());
  });
  await page.goto(url);
  await page.waitForFunction(() => window.replay && window.replay.columns.length > 0);
  return { browser, context, page, errors, requests };
}
module.exports = { open };
