"""How the page looks: two grounds, one accent; the colours of events are those of every vid2ev picture."""

from __future__ import annotations

from typing import Any

ACCENT = "#3b72d9"
ON, OFF = "#e0982f", "#5a8ff0"
MUTED = "#76808f"
BAD = "#b3372b"

CSS = """
:root { --ground: #f6f7f9; --card: #ffffff; --line: #e3e6eb; --ink: #1d222b; --muted: #687080; --accent: #3b72d9;
        --bad: #b3372b; }
.body--dark { --ground: #14171c; --card: #1b1f26; --line: #2c323c; --ink: #dde1e8; --muted: #929aa8; --accent: #6f9cf0;
        --bad: #f08a7c; }
body, .body--dark, .nicegui-content { background: var(--ground) !important; color: var(--ink); }
.nicegui-content { padding: 0; gap: 0; }
* { font-variant-numeric: tabular-nums; }
.v-top { display: flex; align-items: center; gap: 12px; padding: 8px 20px; width: 100%; flex-wrap: wrap;
         border-bottom: 1px solid var(--line); background: var(--card); }
.v-brand { font-weight: 600; font-size: 16px; letter-spacing: .2px; }
.v-source { color: var(--muted); flex: 1; min-width: 120px; overflow: hidden; text-overflow: ellipsis;
            white-space: nowrap; }
.v-main { display: grid; grid-template-columns: 384px minmax(0, 1fr); gap: 16px; padding: 16px 20px; width: 100%;
          align-items: start; }
.v-card { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 12px 16px;
          min-width: 0; }
.v-side { max-height: calc(100vh - 90px); overflow-y: auto; overflow-x: hidden; }
.v-right { display: flex; flex-direction: column; gap: 16px; min-width: 0; }
.v-pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(260px, 1fr)); gap: 16px; }
.v-camera { min-width: 0; } .v-camera .v-line { flex-wrap: nowrap; }
.v-camera .v-muted { white-space: nowrap; overflow: hidden; text-overflow: ellipsis; }
.v-camera img { image-rendering: pixelated; width: 100%; border-radius: 4px; display: block; }
.v-line { display: flex; align-items: center; gap: 12px; flex-wrap: wrap; width: 100%; }
.v-group { color: var(--muted); font-size: 11px; text-transform: uppercase; letter-spacing: .8px; margin: 14px 0 2px; }
.v-row { display: grid; grid-template-columns: 116px minmax(0, 1fr) 104px 24px; column-gap: 10px; align-items: center;
         min-height: 32px; font-size: 13px; }
.v-name { line-height: 1.2; cursor: help; overflow-wrap: anywhere; }
.v-value { grid-column: 3; display: flex; gap: 8px; }
.v-wide { grid-column: 2 / 4; }
.v-value .q-field { flex: 1; min-width: 0; }
.v-value .q-field__control, .v-value .q-field__marginal, .v-value .q-field__native { min-height: 26px !important;
          height: 26px !important; font-size: 13px; padding: 0; }
.v-value .q-field__control { border-bottom: 1px solid var(--line); }
.v-value .q-field__suffix { font-size: 11px; color: var(--muted); padding: 4px 0 0 4px; line-height: 20px; }
.v-value .q-field--focused .q-field__control { border-bottom-color: var(--accent); }
.v-value .v-text .q-field__control { height: auto !important; }
.v-value .v-text textarea { font-family: ui-monospace, monospace; font-size: 11.5px; line-height: 1.45;
          padding: 4px 0 !important; overflow-wrap: anywhere; height: 118px !important; }
.v-value input { text-align: right; } .v-wide input { text-align: left; }
.v-value input[type=number]::-webkit-inner-spin-button { display: none; }
.v-line .q-btn-group .q-btn { padding: 2px 8px; min-height: 28px; font-size: 13px; font-weight: 400; }
.v-slider .q-slider__thumb { width: 12px !important; height: 12px !important; }
.v-slider .q-slider__track { height: 3px; }
.v-reset { color: var(--muted); } .v-idle { visibility: hidden; }
.v-error { grid-column: 1 / 5; color: var(--bad); font-size: 12px; padding: 0 0 6px; line-height: 1.35; }
.v-bad { color: var(--bad); font-size: 12px; } .v-stale { opacity: .35; }
.v-muted { color: var(--muted); font-size: 12px; } .v-status { min-height: 18px; }
.v-chips { display: grid; grid-template-columns: 1fr 1fr; gap: 8px; width: 100%; }
.v-command { font-family: ui-monospace, monospace; font-size: 12.5px; white-space: pre-wrap; overflow-wrap: anywhere;
             background: var(--ground); border: 1px solid var(--line); border-radius: 6px; padding: 10px 12px;
             width: 100%; }
.v-table { width: 100%; border-collapse: collapse; font-size: 12.5px; }
.v-table th { text-align: left; font-weight: 500; color: var(--muted); padding: 4px 10px 4px 0; white-space: nowrap; }
.v-table td { padding: 4px 10px 4px 0; border-top: 1px solid var(--line); vertical-align: top; }
.v-scroll { overflow-x: auto; width: 100%; } .v-scroll .v-table { min-width: 560px; }
.q-tab { min-height: 36px; padding: 0 12px; text-transform: none; } .q-tab__label { font-size: 13px; }
.q-tab-panels { background: transparent !important; } .q-tab-panel { padding: 12px 0 0; }
.body--dark .text-primary { --q-primary: var(--accent); }
.q-btn:focus-visible, .q-tab:focus-visible, .q-toggle:focus-visible, .q-slider__track-container:focus-visible {
  box-shadow: 0 0 0 2px var(--accent); border-radius: 4px; }
.q-btn { text-transform: none; font-weight: 500; } .q-btn--dense.q-btn--rectangle { padding: 2px 10px; }
.v-line .q-select { font-size: 13px; } .v-line .q-select .q-field__control { min-height: 30px; height: 30px; }
@media (max-width: 900px) {
  .v-main { grid-template-columns: minmax(0, 1fr); padding: 12px; gap: 12px; } .v-right { order: -1; }
  .v-side { max-height: none; } .v-top { padding: 8px 12px; gap: 4px; }
  .v-top .q-btn--dense.q-btn--rectangle { padding: 2px 6px; }
  .v-source { min-width: 40px; margin-left: 8px; }
}
"""


def say(label: Any, text: str, bad: bool = False) -> None:
    """Have a quiet label say something, or that something is wrong."""
    label.text = text
    label.classes("v-bad" if bad else "v-muted", remove="v-muted" if bad else "v-bad")


def refuse(why: str | None) -> None:
    """Say why a change was refused, if it was, for as long as nobody has read it."""
    from nicegui import ui  # (charts, which need no page, have their colours from here)

    if why:
        ui.notify(why, type="negative", multi_line=True, timeout=0, close_button=True)
