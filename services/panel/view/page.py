"""The controls of one browser: what is always there, the tabs, and what the browser tells of itself."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite
from typing import Literal

import viser

from gemelo.schemas.device import DeviceMode
from gemelo.schemas.device_link import warning_of, why_not_usable
from gemelo.schemas.reasons import Reason
from gemelo.services.panel.model.availability import reasons
from gemelo.services.panel.model.operator import Operator
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.view.arm_pages import ArmPage, arms_line
from gemelo.services.panel.view.browser import CHANNEL, STOP_SIGN, Browser, Stops, read_browser, script_html
from gemelo.services.panel.view.camera_box import CameraBox
from gemelo.services.panel.view.control_box import ControlBox
from gemelo.services.panel.view.kit import Kit, Mirror, Steady, at_once, box, esc, set_if_new, without_event
from gemelo.services.panel.view.tabs.device import DeviceTab
from gemelo.services.panel.view.tabs.jog import JogTab
from gemelo.services.panel.view.tabs.move import MoveTab
from gemelo.services.panel.view.tabs.programs import ProgramsTab
from gemelo.services.panel.view.tabs.scene import SceneTab, require_small
from gemelo.services.panel.view.tabs.state import StateTab
from gemelo.services.panel.view.tabs.teach import TeachTab
from gemelo.services.panel.view.world import DrawnWorld
from gemelo.services.panel.words.words import LANGUAGES, Words, language_of

MARK = 1.0  # [s] between two marks by which a browser's lag is measured
LATE, LATE_AGAIN = 0.2, 5.0  # [s] chosen: a longer lag is measured again after so long
BRAND = (28, 126, 214)
SLOW = 12.0  # [Hz] a browser that draws slower has no graphics card, and gets no shadows
WIDTH = 440.0  # [pixels] of the controls: room for all tabs in one row
GOOD, BAD, NEUTRAL = "#2f9e44", "#e03131", "#868e96"


@dataclass(frozen=True)
class Appearance:
    """What a browser's controls are built for."""

    language: str = "en"
    is_dark: bool = False


class Page:
    """Built anew when the language or the colours change; its tabs and controls have the names by which a person knows
    them."""

    def __init__(
        self, client: viser.ClientHandle, operator: Operator, world: DrawnWorld, arms: tuple[ArmPage, ...] = ()
    ) -> None:
        """`arms` are all that have a page, where there are several."""
        self.client, self._operator, self._world, self._arms = client, operator, world, arms
        self.browser: Browser | None = None
        self.lag = float("nan")  # [s] from a header that was sent to the word that it is drawn
        self._began = time.monotonic()
        self._marked = 0.0
        self.wanted = Appearance()  # set by any thread: `refresh` builds it
        self.was_chosen = False  # by the browser's own settings, or by a person
        self.built: Appearance | None = None
        self._is_plain = False  # drawn without shadows
        self._told = 0
        self._stops = Stops()
        self._said = ""  # by the header
        self._shown_lag = Steady(share=0.5, least=0.05)  # [s]

    def refresh(self, readings: Readings, now: float) -> None:
        """Shows what has changed, at `now` [s] monotonic. All is built in here, by one thread: callbacks only say what
        is wanted."""
        if self.built != self.wanted:
            self._rebuild(self.wanted)
        self.kit.refresh(reasons(self._operator.arm, readings))
        is_held = readings.state is not None and readings.state.mode is DeviceMode.HOLD
        set_if_new(self.hold, "visible", not is_held)
        set_if_new(self.resume, "visible", is_held)
        self._show_header(readings, now)
        self.control.refresh(readings)
        self._show_problem()
        self.move.refresh(readings)
        self.jog.refresh(readings)
        self.device.refresh(readings)
        self.scene.refresh(readings)
        self.cameras.refresh()
        self.teach.refresh(readings)
        self.programs.refresh(readings)
        pose = self._world.tool_pose
        self.state.refresh(readings, self.browser, self.lag, (*pose.position, *pose.orientation))
        if readings.state is not None:
            self._shown_speed.show(round(100.0 * readings.state.speed))

    def close(self) -> None:
        """Takes away what it has put into the scene."""
        if self.built is not None:
            self.scene.close()

    def _build(self, appearance: Appearance) -> None:
        self._words = words = Words(appearance.language)
        self.kit = kit = Kit(self.client, self._operator, words)
        gui = self.client.gui
        gui.configure_theme(dark_mode=appearance.is_dark, show_logo=False, show_share_button=False, brand_color=BRAND)
        gui.set_panel_label(f"gemelo · {self._operator.arm.name}")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)
        kit.line(script_html())
        if self._arms:
            kit.line(arms_line(self._arms, self._operator.arm.name, words))
        self.header = kit.line()
        kit.urgent(f"{STOP_SIGN} {words('stop')}", self._stop, color="red")
        self.hold = kit.button(words("hold"), self._operator.arm.hold, color="gray", needs="hold")
        self.resume = kit.button(words("resume"), self._operator.arm.resume, color="gray", needs="resume")
        self.speed = gui.add_slider(words("speed"), 0, 100, 1, 100)
        self._shown_speed = Mirror(self.speed)
        self.speed.on_update(
            lambda event: self._operator.set_speed(event.target.value / 100.0) if event.client_id is not None else None
        )
        self.control = ControlBox(kit)
        self.problem = kit.line()
        self.nearest = kit.button(words("take_nearest"), self._take_nearest, color="orange")
        self.understood = kit.button(words("understood"), self._operator.forget_problem, color="gray")
        tabs = gui.add_tab_group()
        with tabs.add_tab(words("tab_move")):
            self.move = MoveTab(kit, self._world)
        with tabs.add_tab(words("tab_jog")):
            self.jog = JogTab(kit)
        with tabs.add_tab(words("tab_device")):
            self.device = DeviceTab(kit)
        with tabs.add_tab(words("tab_teach")):
            self.teach = TeachTab(kit)
        with tabs.add_tab(words("tab_programs")):
            self.programs = ProgramsTab(kit)
        with tabs.add_tab(words("tab_scene")):
            self.scene = SceneTab(kit, self._world)
            self.cameras = CameraBox(kit)
        with tabs.add_tab(words("tab_state")):
            self.state = StateTab(kit)
            self._settings(appearance)
        self._add_commands()
        self._channel = gui.add_text(CHANNEL, CHANNEL)
        self._channel.on_update(at_once(self._hear_stops))  # before all that a thread is needed for
        self._channel.on_update(lambda event: self.hear(event.target.value))

    def _settings(self, appearance: Appearance) -> None:
        words, gui = self._words, self.client.gui
        names = {each.name: key for key, each in LANGUAGES.items()}
        now = LANGUAGES[words.language].name
        language = gui.add_dropdown("Language / Idioma", tuple(names), initial_value=now)
        dark = gui.add_checkbox(words("dark"), appearance.is_dark)

        @language.on_update
        def _(event: viser.GuiEvent[viser.GuiDropdownHandle[str]]) -> None:
            if event.client_id is not None:
                self.was_chosen = True
                self.wanted = replace(self.wanted, language=names[event.target.value])

        @dark.on_update
        def _(event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
            if event.client_id is not None:
                self.was_chosen = True
                self.wanted = replace(self.wanted, is_dark=event.target.value)

    def _add_commands(self) -> None:
        """The same by keys, and in the palette that Ctrl-K opens."""
        words, gui, operator = self._words, self.client.gui, self._operator
        keys: tuple[tuple[str, Literal["H", "R", "P"], Callable[[], object]], ...] = (
            ("hold", "H", lambda: operator.guarded(operator.arm.hold)),
            ("resume", "R", lambda: operator.guarded(operator.arm.resume)),
            ("plan", "P", operator.plan),
        )
        gui.add_command(words("stop"), hotkey="space").on_trigger(at_once(operator.stop))
        for name, key, action in keys:
            gui.add_command(words(name), hotkey=key).on_trigger(without_event(action))

        self.client.scene.remove_click_callback()  # of the page as it was built before
        self.client.scene.on_click(modifier="shift")(self._world.place_goal)

    def _rebuild(self, appearance: Appearance) -> None:
        self.close()
        self.client.gui.reset()
        self._told, self._said = 0, ""
        self._build(appearance)
        self.built = appearance

    def hear(self, text: str) -> None:
        """What the browser tells of itself, as its script writes it into the hidden field."""
        browser = read_browser(text)
        if browser is None:
            return
        previous, self.browser = self.browser, browser
        if browser.clicked is not None and previous is not None and browser.clicked != previous.clicked:
            self.cameras.point(browser.clicked)
        if browser.too_large:
            self._operator.guarded(lambda: require_small(browser.too_large, self._words))
        if 0.0 < browser.rate < SLOW and not self._is_plain:
            self._is_plain = True
            self.client.scene.configure_default_lights(cast_shadow=False)
        if previous is None or browser.sent != previous.sent:
            self.lag = max(0.0, time.monotonic() - self._began - browser.sent / 1000.0)
        if previous is None and browser.height:
            self._world.step_back(self.client, max(1.0, browser.width - WIDTH) / browser.height)
        if not self.was_chosen:
            self.was_chosen = True
            self.wanted = Appearance(language_of(browser.language), browser.dark)

    def _stop(self) -> None:
        self._stops.come += 1
        self._operator.stop()

    def _hear_stops(self) -> None:
        browser = read_browser(self._channel.value)
        if browser is not None and self._stops.has_missed(browser):
            self._operator.stop()

    def _show_header(self, readings: Readings, now: float) -> None:
        """Sent where it says something new, with a new mark; that of its lag is new only where it has much changed, and
        a lag that is long is measured again: a page that has just loaded is late, and not for long."""
        lag = f" · {1000 * self._shown_lag.of(self.lag):.0f} ms" if isfinite(self.lag) and readings.is_live else ""
        text, color = self._header_text(readings, lag)
        is_measured_again = self.lag > LATE and now - self._marked > LATE_AGAIN
        if text == self._said and not is_measured_again:
            return
        self._said = text
        if now - self._marked > MARK:
            self._marked = now
        mark = f'<span data-gemelo-sent="{1000 * (self._marked - self._began):.0f}"></span>'
        set_if_new(self.header, "content", mark + box(text, color))

    def _header_text(self, readings: Readings, lag: str) -> tuple[str, str]:
        """What it says, and its colour."""
        words, state = self._words, readings.state
        if state is None or not readings.is_live:
            age = f"{readings.age:.1f} s" if isfinite(readings.age) else "-"
            trouble = self._trouble(readings)
            return f"<b>{esc(words('not_live', age=age))}</b> {esc(words.why(trouble) if trouble else '')}", BAD
        worst = max((abs(error) for error in readings.step_errors.values()), default=0.0)
        error = words("step_error", steps=f"{worst:.2f}")
        if readings.status is not None and readings.status.open_loop:
            error = words("sent_not_verified")
        text = f"<b>{esc(words(f'mode_{state.mode.name.lower()}'))}</b> · {esc(error)} · {esc(words('live_data'))}{lag}"
        if said := readings.fault or self._trouble(readings):
            return f"{text}<br>{esc(words.why(said))}", BAD
        return text, GOOD if state.armed and all(state.referenced) else NEUTRAL

    @staticmethod
    def _trouble(readings: Readings) -> Reason | None:
        """Why the device is not usable, or what else a person has to mend; None where all is well."""
        status = readings.status
        if status is None:
            return None
        return warning_of(status) if status.online else why_not_usable(status, time.time_ns())

    def _show_problem(self) -> None:
        told = self._operator.newest_problem
        number = told.number if told is not None else 0
        if (number == self._told and self._told != 0) or (number == 0 and self.problem.content == ""):
            set_if_new(self.understood, "visible", number != 0)
            set_if_new(self.nearest, "visible", told is not None and told.problem.has_nearest)
            return
        self._told = number
        content = ""
        if told is not None:
            heading, text = self._words.problem(told.problem)
            content = box(f"<b>{esc(heading)}</b><br>{esc(text)}", BAD)
        set_if_new(self.problem, "content", content)
        set_if_new(self.understood, "visible", number != 0)
        set_if_new(self.nearest, "visible", told is not None and told.problem.has_nearest)

    def _take_nearest(self) -> None:
        told = self._operator.newest_problem
        if told is not None:
            self._operator.take_nearest(told.problem)
