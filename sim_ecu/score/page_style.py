"""The look of the score's page: light and dark, from 320 px up, and on paper."""

STYLE = """
:root { --text: #1d2329; --back: #fff; --line: #c9d0d6; --soft: #f1f4f6; --missed: #fbd9d3; --loud: #b54708;
  color-scheme: light dark }
@media screen and (prefers-color-scheme: dark) {
  :root { --text: #dfe4e8; --back: #16191c; --line: #434b52; --soft: #21262b; --missed: #5e231d; --loud: #f79009 }
}
* { box-sizing: border-box }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 68rem; margin: 0 auto; padding: 1rem; color: var(--text);
  background: var(--back); overflow-wrap: anywhere }
h1 { font-size: 1.6rem; line-height: 1.25 } h2 { margin: 2.4rem 0 .4rem; font-size: 1.25rem }
a { color: inherit } nav { margin: 1rem 0 } nav a { margin-right: .8rem; white-space: nowrap }
figure { margin: 1.6rem 0 } img { display: block; width: 100%; height: auto }
figcaption { margin-top: .3rem }
.loud { border: 3px solid var(--loud); border-radius: .4rem; padding: .6rem 1rem; font-size: 1.1rem }
.loud strong { color: var(--loud) }
table { border-collapse: collapse; margin: .6rem 0 1.4rem; font-size: .87rem; max-width: 100% }
td, th { border: 1px solid var(--line); padding: .2rem .5rem; text-align: right; vertical-align: top; font-weight: 400;
  overflow-wrap: break-word }
thead th { background: var(--soft); font-weight: 600 } tr > :first-child { text-align: left }
.missed { background: var(--missed) }
@media screen and (max-width: 40rem) { table, tbody, tr, td, tbody th { display: block } CARDS }
@media screen and (max-width: 68rem) { .wide, .wide tbody, .wide tr, .wide td, .wide tbody th { display: block } WIDE }
@media print {
  body { max-width: none; padding: 0; font-size: 10pt } nav { display: none }
  table { font-size: 6.5pt } td, th { padding: .1rem .2rem }
  figure, tr { break-inside: avoid } h2 { break-after: avoid }
}
"""
_CARD = """
  {of}thead {{ position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%) }}
  {of}tr {{ border: 1px solid var(--line); border-radius: .3rem; margin-bottom: .6rem; padding: .2rem .6rem }}
  {of}td, {of}tbody th {{ border: 0; padding: .1rem 0 }}
  {of}tbody th {{ font-weight: 600 }}
  {of}td {{ display: flex; justify-content: space-between; gap: 1rem }}
  {of}td::before {{ content: attr(data-of); text-align: left; opacity: .75 }}
  {of}td:empty, {of}tbody th:empty {{ display: none }}
"""
STYLE = STYLE.replace("CARDS", _CARD.format(of="")).replace("WIDE", _CARD.format(of=".wide "))
