# SPDX-License-Identifier: Apache-2.0
"""The look of the page: one style sheet, light and dark."""

CSS = """
:root {
  color-scheme: light dark;
  --page: #f6f6f3; --card: #fdfdfc; --ink: #14140f; --soft: #52514e; --faint: #8b8a83; --rule: #e2e1da;
  --true: #8b8a83; --odometry: #d95926; --corrected: #2a78d6; --accepted: #1a8a3c; --false: #d03b3b; --refused: #a8710a;
  --seen: #8fb6e6;
  --s0: #2a78d6; --s1: #1baf7a; --s2: #c98500; --s3: #008300; --s4: #4a3aa7; --s5: #d03b3b; --s6: #d55181;
  --s7: #8b8a83;
}
@media (prefers-color-scheme: dark) {
  :root {
    --page: #121211; --card: #1b1b19; --ink: #f4f3ee; --soft: #c3c2b7; --faint: #8b8a83; --rule: #30302d;
    --true: #9a9991; --odometry: #ef7b4a; --corrected: #5aa0ee; --accepted: #3fb865; --false: #ef6a6a;
    --refused: #e0a63a;
    --seen: #3d6ba3;
    --s0: #5aa0ee; --s1: #2fc48f; --s2: #e0a63a; --s3: #4cb84c; --s4: #9a8cf0; --s5: #ef6a6a; --s6: #ec7fa6;
  --s7: #9a9991;
  }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--page); color: var(--ink); font: 15px/1.5 system-ui, -apple-system, "Segoe UI",
  Roboto, "Noto Sans", sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 32px 24px 64px; }
h1 { font-size: 26px; line-height: 1.25; margin: 0 0 4px; letter-spacing: -0.01em; }
article + article { margin-top: 72px; border-top: 1px solid var(--rule); padding-top: 40px; }
h2 { font-size: 18px; margin: 40px 0 4px; }
p { margin: 4px 0 12px; color: var(--soft); max-width: 76ch; }
.card { background: var(--card); border: 1px solid var(--rule); border-radius: 8px; padding: 16px; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 12px; margin: 20px 0 8px; }
.tile .value { font-size: 25px; font-weight: 600; line-height: 1.2; font-variant-numeric: tabular-nums; }
.tile .name, .tile .note { color: var(--soft); font-size: 13px; }
.tile.good .value { color: var(--accepted); } .tile.bad .value { color: var(--false); }
.two { display: grid; grid-template-columns: repeat(auto-fit, minmax(420px, 1fr)); gap: 12px; }
figure { margin: 0 0 12px; } figcaption { color: var(--soft); font-size: 13px; margin-top: 6px; }
svg { display: block; width: 100%; height: auto; }
svg text { font-size: 12px; fill: var(--faint); } svg text.name { fill: var(--ink); font-weight: 600;
  paint-order: stroke; stroke: var(--card); stroke-width: 3px; stroke-linejoin: round; }
.grid { stroke: var(--rule); stroke-width: 1; }
.line { fill: none; stroke-width: 2; stroke-linejoin: round; stroke-linecap: round; }
.line.true { stroke: var(--true); stroke-width: 4; opacity: .55; }
.line.odometry { stroke: var(--odometry); } .line.corrected { stroke: var(--corrected); }
.line.faint { stroke: var(--faint); stroke-width: 1; opacity: .6; }
.line.accepted { stroke: var(--accepted); } .line.false { stroke: var(--false); }
.line.link { stroke-width: 1.2; opacity: .75; }
.dot { stroke: var(--card); stroke-width: .8; }
.dot.start { fill: var(--ink); } .dot.seen { fill: var(--seen); stroke: none; }
.dot.accepted { fill: var(--accepted); } .dot.false { fill: var(--false); } .dot.refused { fill: var(--refused); }
.series-0 { fill: var(--s0); } .series-1 { fill: var(--s1); } .series-2 { fill: var(--s2); }
.series-3 { fill: var(--s3); } .series-4 { fill: var(--s4); } .series-5 { fill: var(--s5); }
.series-6 { fill: var(--s6); } .series-7 { fill: var(--s7); }
.legend { list-style: none; display: flex; flex-wrap: wrap; gap: 4px 18px; margin: 0 0 8px; padding: 0; font-size: 13px;
  color: var(--soft); }
.swatch { display: inline-block; width: 14px; height: 4px; border-radius: 2px; margin-right: 6px;
  vertical-align: middle; }
.swatch.true { background: var(--true); } .swatch.odometry { background: var(--odometry); }
.swatch.corrected { background: var(--corrected); } .swatch.accepted { background: var(--accepted); }
.swatch.false { background: var(--false); } .swatch.refused { background: var(--refused); }
.swatch.seen { background: var(--seen); }
table { border-collapse: collapse; width: 100%; font-size: 14px; font-variant-numeric: tabular-nums; }
th { text-align: left; color: var(--soft); font-weight: 500; } th, td { padding: 6px 12px 6px 0; vertical-align: top;
  border-bottom: 1px solid var(--rule); }
tr:last-child td { border-bottom: 0; } td.number, th.number { text-align: right; white-space: nowrap; }
td.meter { width: 40%; } .meter div { height: 8px; border-radius: 4px; background: var(--corrected); min-width: 2px; }
.meter .p95 { background: var(--seen); margin-top: 3px; }
.pair { margin-bottom: 12px; } .pair .row { display: grid; grid-template-columns: repeat(3, 1fr); gap: 8px; }
.pair img { width: 100%; display: block; border-radius: 4px; } .pair .what { font-size: 12px; color: var(--faint); }
.pair .words { font-size: 14px; margin: 0 0 8px; color: var(--ink); max-width: none; }
.tag { display: inline-block; font-size: 12px; font-weight: 600; border-radius: 4px; padding: 1px 7px;
  margin-right: 8px;  border: 1px solid currentColor; }
.tag.accepted { color: var(--accepted); } .tag.false { color: var(--false); } .tag.refused { color: var(--refused); }
.detail { color: var(--soft); } footer { color: var(--faint); font-size: 13px; margin-top: 40px; }
@media (max-width: 560px) { .two { grid-template-columns: 1fr; } }
@media print { body { background: none; } .card { break-inside: avoid; } }
"""
