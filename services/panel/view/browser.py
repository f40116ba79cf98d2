"""The few lines of JavaScript that viser's page lacks, and what they tell of the browser.

Space is Stop wherever the focus is but in a text field: a focused button would else be pressed by it, and a number
field would swallow it. The arrow keys hold the jog buttons that name them, and press them when they are let go: only of
a person's own keyboard, after a click or the Tab key on this page since it had the focus last, and never in a frame of
another page. The
browser's language, its wish for dark colours, its frame rate and the newest header that it has drawn come back through
a hidden text field: with each header that bears a new mark, and when the rate has changed; a page on which nothing
changes says nothing. viser sends only the newest of the messages of 50 ms, so nothing of this is sent within ACTING
of what a person does: it would replace his click. A click into the image of a camera comes at once: a press and its
release are taken for it, since the image may have been replaced by the next one between the two.
Where the Stop button is scrolled out of sight or covered, a second one stands at the bottom, beside the controls where
there is room, else upon them. While the controls are built anew there is no such button, or one that the page no longer
knows: every Stop is counted, and told through the hidden field as well.
The tabs stand closer, so that all of them have room in one row, and the two jog buttons of an axis share a row from
their first frame on: none moves away below a pointer. A file that is too large is not sent at all.
"""

from __future__ import annotations

import html
from dataclasses import dataclass

import msgspec

CHANNEL = "gemelo-browser"  # how the hidden field's text begins
CAMERA_MARK = "data-gemelo-camera"  # the attribute of a camera's image that names the camera
LARGEST_UPLOAD = 20_000_000  # [bytes] chosen: the planner takes 500,000 triangles, which are 25 MB
DRAGGED = 6  # [pixels] of the page from the press to the release, from which on it was no click
RATE_CHANGED = 0.3  # share of the frame rate by which it must change before the browser tells it by itself
STILL_MEANT = 5000.0  # [ms] chosen: an older Stop that a browser tells when it is connected again stops nothing
ACTING = 150.0  # [ms] chosen: three of viser's intervals after what a person has done
TOLD_AGAIN = 300.0  # [ms] chosen: a Stop is told again while it is meant, as viser may have put another message first
STOP_SIGN = "■"  # how the Stop button's text begins, in every language

SCRIPT = """
(() => {
  if (window.gemelo) return;
  window.gemelo = true;
  document.head.insertAdjacentHTML('beforeend', '<style>[role=tab] { padding-inline: 6px !important; }</style>');
  const buttons = () => [...document.querySelectorAll('button')];
  const second = document.createElement('button');
  const findStop = () => buttons().find((b) => b !== second && b.textContent.trim().startsWith('STOP_SIGN'));
  Object.assign(second.style, {position: 'fixed', right: '1em', bottom: '1em', zIndex: 10000, display: 'none',
    padding: '0.8em 1.6em', background: '#e03131', color: '#fff', font: 'bold 16px sans-serif',
    border: '2px solid #fff', borderRadius: '8px', cursor: 'pointer'});
  second.dataset.gemeloStop = '';
  second.setAttribute('aria-hidden', 'true');
  let stops = 0, toldStops = 0, stoppedAt = 0;
  const noteStop = () => { stops += 1; stoppedAt = performance.now(); };
  const callStop = () => { const stop = findStop(); if (stop) stop.click(); else noteStop(); };
  second.addEventListener('click', callStop);
  document.body.append(second);
  window.addEventListener('click', (e) => { const stop = findStop(); if (stop && stop.contains(e.target)) noteStop(); },
    true);
  const keepStop = () => {
    const stop = findStop(), box = stop && stop.getBoundingClientRect();
    const seen = box && box.width && document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
    second.style.display = stop && !(seen && (stop.contains(seen) || second.contains(seen))) ? 'block' : 'none';
    second.style.right = (box && box.x > 260 ? innerWidth - box.x + 24 : 16) + 'px';
    second.textContent = stop ? stop.textContent : '';
  };
  ['scroll', 'resize', 'click'].forEach((kind) => window.addEventListener(kind, keepStop, true));
  const keys = {ArrowLeft: '◀', ArrowRight: '▶', ArrowUp: '▲', ArrowDown: '▼', PageUp: 'PgUp', PageDown: 'PgDn'};
  const isText = (t) => t.tagName === 'TEXTAREA' || t.isContentEditable || (t.tagName === 'INPUT'
    && !['range', 'checkbox', 'radio', 'button'].includes(t.type) && !['decimal', 'numeric'].includes(t.inputMode));
  const isNumber = (t) => t.tagName === 'INPUT' || (t.getAttribute && t.getAttribute('role') === 'slider');
  const held = {};
  let isGiven = false;
  window.addEventListener('pointerdown', (e) => { if (e.isTrusted) isGiven = true; }, true);
  window.addEventListener('keydown', (e) => { if (e.isTrusted && e.code === 'Tab') isGiven = true; }, true);
  const mayJog = (e) => e.isTrusted && isGiven && window.top === window && document.hasFocus();
  const point = (button, kind) => button.dispatchEvent(
    new PointerEvent(kind, {bubbles: true, button: 0, pointerId: 1, isPrimary: true}));
  const take = (e) => { e.preventDefault(); e.stopImmediatePropagation(); };
  window.addEventListener('keydown', (e) => {
    if (isText(e.target)) return;
    if (e.code === 'Space') {
      take(e);
      if (!e.repeat) callStop();
    } else if (keys[e.code] && !isNumber(e.target) && mayJog(e)) {
      const button = buttons().find((b) => b.offsetParent && b.textContent.includes(keys[e.code]));
      if (!button) return;
      take(e);
      if (!e.repeat && !held[e.code]) { held[e.code] = button; point(button, 'pointerdown'); }
    }
  }, true);
  const release = (code) => { const button = held[code]; if (button) point(button, 'pointerup'); delete held[code];
    return button; };
  window.addEventListener('keyup', (e) => {
    if (e.code === 'Space' && !isText(e.target)) take(e);
    const button = release(e.code);
    if (button) button.click();
  }, true);
  window.addEventListener('blur', () => { isGiven = false; Object.keys(held).forEach(release); });
  let pressed = null, clicked = null, clicks = 0;
  window.addEventListener('pointerdown', (e) => {
    const camera = e.isPrimary && !e.button && e.target.getAttribute && e.target.getAttribute('CAMERA_MARK');
    if (!camera) { pressed = null; return; }
    const box = e.target.getBoundingClientRect();
    pressed = {x: e.clientX, y: e.clientY, at: {camera: camera,
      x: (e.clientX - box.left) / box.width, y: (e.clientY - box.top) / box.height}};
  }, true);
  window.addEventListener('pointercancel', () => { pressed = null; }, true);
  window.addEventListener('pointerup', (e) => {
    if (pressed && Math.hypot(e.clientX - pressed.x, e.clientY - pressed.y) < DRAGGED) {
      clicks += 1;
      clicked = {...pressed.at, number: clicks};
    }
    pressed = null;
  }, true);
  let tooLarge = 0;
  window.addEventListener('change', (e) => {
    const size = e.target.files && e.target.files.length ? e.target.files[0].size : 0;
    if (size <= LARGEST_UPLOAD) return;
    e.stopImmediatePropagation();
    e.target.value = '';
    tooLarge = size;
  }, true);
  const arrange = () => buttons().forEach((b) => {
    const place = b.parentElement.style;
    const isOfPair = / [+-](  \\S+)?$/.test(b.textContent);
    if (isOfPair && !place.width) Object.assign(place, {display: 'inline-block', width: 'calc(50% - 1.25em)'});
  });
  new MutationObserver(arrange).observe(document.body, {childList: true, subtree: true});
  let acted = 0, isDown = false;
  const findChannel = () => [...document.querySelectorAll('input')].find((i) => i.value.startsWith('CHANNEL'));
  const act = (e) => { if (e.target !== findChannel()) acted = performance.now(); };
  ['pointerdown', 'pointerup', 'click', 'keydown', 'keyup', 'input', 'change', 'wheel'].forEach((kind) =>
    window.addEventListener(kind, act, true));
  window.addEventListener('pointerdown', () => { isDown = true; }, true);
  ['pointerup', 'pointercancel', 'blur', 'pointermove'].forEach((kind) =>
    window.addEventListener(kind, (e) => { isDown = isDown && kind === 'pointermove' && e.buttons > 0; }, true));
  const set = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set;
  let frames = 0, began = performance.now(), rate = 0, told = '', toldClicks = 0, toldRate = 0,
    toldAt = 0;
  const tell = () => {
    frames += 1;
    const now = performance.now();
    if (now - began > 1000) { rate = frames * 1000 / (now - began); frames = 0; began = now; keepStop(); }
    const field = findChannel();
    const sent = (document.querySelector('[data-gemelo-sent]') || {dataset: {}}).dataset.gemeloSent || '';
    if (field) {
      field.parentElement.parentElement.parentElement.parentElement.style.display = 'none';
      const hasNewRate = Math.abs(rate - toldRate) > RATE_CHANGED * toldRate;
      const isUrgent = field.value === 'CHANNEL' || clicks !== toldClicks || stops !== toldStops || tooLarge;
      const isActing = isDown || now - acted < ACTING;
      if (isActing) told = sent;  // told later, the mark would be that of a lag that is none
      const isMeant = stops > 0 && now - stoppedAt < STILL_MEANT && now - toldAt > TOLD_AGAIN;
      if (isUrgent || (!isActing && (sent !== told || hasNewRate || isMeant))) {
        told = sent;
        toldAt = now;
        toldClicks = clicks;
        toldStops = stops;
        toldRate = rate;
        set.call(field, 'CHANNEL ' + JSON.stringify({sent: Number(sent), language: navigator.language, rate: rate,
          dark: matchMedia('(prefers-color-scheme: dark)').matches, width: innerWidth, height: innerHeight,
          too_large: tooLarge, clicked: clicked, stops: stops, stopped_ago: now - stoppedAt}));
        tooLarge = 0;
        field.dispatchEvent(new Event('input', {bubbles: true}));
      }
    }
    requestAnimationFrame(tell);
  };
  tell();
})()
"""


@dataclass(frozen=True)
class Click:
    """A place in the image of a camera."""

    camera: str
    x: float  # from 0 at the left to 1
    y: float  # from 0 at the top to 1
    number: int  # of the click, counted since the browser has loaded the page


@dataclass(frozen=True)
class Browser:
    """What a browser has told of itself."""

    sent: float = 0.0  # [ms] the mark of the newest header that it had drawn
    language: str = ""  # as "es-MX"
    rate: float = 0.0  # [Hz] frames a second
    dark: bool = False
    width: int = 0  # [pixels]
    height: int = 0
    too_large: int = 0  # [bytes] of a file that it was asked to upload and did not
    clicked: Click | None = None  # the newest
    stops: int = 0  # how often Stop was called since the browser has loaded the page
    stopped_ago: float = 0.0  # [ms] since the newest of these


@dataclass
class Stops:
    """Those of one browser that have come: a button that is built anew loses what is still on its way."""

    come: int = 0

    def has_missed(self, browser: Browser) -> bool:
        """True if the browser has called for a Stop that did not come, and still means it; asked in the order in which
        the browser's words come, so that none is carried out twice."""
        is_missed = browser.stops > self.come
        self.come = max(self.come, browser.stops)
        return is_missed and browser.stopped_ago < STILL_MEANT


def script_html() -> str:
    """An invisible element whose loading fails, and so runs the script: viser puts no other code on the page."""
    script = SCRIPT
    values = {
        "STOP_SIGN": STOP_SIGN,
        "CHANNEL": CHANNEL,
        "CAMERA_MARK": CAMERA_MARK,
        "LARGEST_UPLOAD": str(LARGEST_UPLOAD),
        "DRAGGED": str(DRAGGED),
        "RATE_CHANGED": str(RATE_CHANGED),
        "ACTING": str(ACTING),
        "STILL_MEANT": str(STILL_MEANT),
        "TOLD_AGAIN": str(TOLD_AGAIN),
    }
    for name, value in values.items():
        script = script.replace(name, value)
    return f'<img src="data:," alt="" style="display:none" onerror="{html.escape(script, quote=True)}">'


def read_browser(text: str) -> Browser | None:
    """What the hidden field says; None for anything else."""
    if not text.startswith(f"{CHANNEL} "):
        return None
    try:
        return msgspec.json.decode(text[len(CHANNEL) + 1 :], type=Browser)
    except msgspec.MsgspecError:
        return None
