"""The look of a fleet's page: the score's, with the report's colours of surfaces."""

from sim_ecu.score.page_style import STYLE as SCORE

STYLE = (
    SCORE
    + """
:root { --c0: #e3eef6; --c1: #b3d2e8; --c2: #77aed6; --c3: #3f82b8; --c4: #1d4f7c; --nv: #f0dfc2 }
@media screen and (prefers-color-scheme: dark) {
  :root { --c0: #20303d; --c1: #284c66; --c2: #2f6b95; --c3: #4a93c6; --c4: #a8d3f2; --nv: #5a4a30 }
}
.c0 { fill: var(--c0); background: var(--c0) } .c1 { fill: var(--c1); background: var(--c1) }
.c2 { fill: var(--c2); background: var(--c2) } .c3 { fill: var(--c3); background: var(--c3) }
.c4 { fill: var(--c4); background: var(--c4) } .nv { fill: var(--nv); background: var(--nv) }
svg { display: block; width: 100%; min-width: 7rem; border: 1px solid var(--line); shape-rendering: crispEdges }
svg.columns { height: 2.2rem } svg.bar { height: .9rem }
.legend { list-style: none; display: flex; flex-wrap: wrap; gap: .2rem 1rem; padding: 0; margin: .4rem 0 1rem }
.key { display: inline-block; width: 1rem; height: 1rem; margin-right: .35rem; border: 1px solid var(--line);
  vertical-align: -.15rem }
table { width: 100% } td.text, th.text, th.picture { text-align: left }
td:not([class]) { white-space: nowrap } td.picture { width: 14rem } .train th[scope=row] { min-width: 11rem }
summary { cursor: pointer; padding: .25rem 0 } .train > summary { border-top: 1px solid var(--line); padding: .5rem 0 }
.train > summary strong { font-size: 1.05rem } .more > summary { color: var(--loud) }
code { font: .85em/1.4 ui-monospace, monospace; background: var(--soft); padding: .1rem .3rem; user-select: all }
tr details { max-width: 26rem; text-align: left; font-weight: 400 } tr ul { margin: .2rem 0; padding-left: 1.1rem }
:target { outline: 2px solid var(--loud) }
.bad { background: var(--missed) }
@media screen and (max-width: 68rem) { td.picture { width: auto } .wide td.picture svg { max-width: 22rem } }
@media screen and (max-width: 40rem) { td > svg { max-width: 60vw } }
"""
)
