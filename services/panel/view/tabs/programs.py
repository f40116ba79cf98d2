"""The tab that edits, checks and runs programs."""

from __future__ import annotations

from collections.abc import Callable

import gemelo
from gemelo.programs import (
    CheckedLeg,
    ProgramCheck,
    RunState,
    RunStatus,
    StepPath,
    export_script,
    path_text,
)
from gemelo.services.panel.model.problems import problem_of
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.view.kit import Kit, box, esc, note, set_if_new
from gemelo.services.panel.view.tabs.new_step import NewStep
from gemelo.services.panel.words.step_text import step_text

COLORS = {
    RunStatus.RUNNING: "#2f9e44", RunStatus.PAUSED: "#f59f00", RunStatus.FAILED: "#e03131",
    RunStatus.STOPPED: "#868e96", RunStatus.DONE: "#1c7ed6", RunStatus.READY: "#868e96",
}  # fmt: skip


class ProgramsTab:
    """The program that is open, its steps, one of them chosen, and its run."""

    def __init__(self, kit: Kit) -> None:
        self._kit, self._operator, self._teaching = kit, kit.operator, kit.operator.teaching
        words, gui = kit.words, kit.gui
        self._version = -1
        self._files: tuple[str, ...] = ()
        self._paths: dict[str, StepPath] = {}
        self.file = gui.add_dropdown(words("program"), (words("none"),))
        self.file.on_update(lambda event: self.open() if event.client_id is not None else None)
        self.name = gui.add_text(words("name"), self._teaching.program.name)
        kit.button(words("save"), lambda: self._teaching.save(self.name.value), color="blue")
        kit.button(words("new_program"), self.new, color="gray")
        self.state = kit.line()
        self.steps = kit.line()
        self.step = gui.add_dropdown(words("step"), (words("whole_program"),))
        kit.button(words("check"), self._check, color="blue")
        kit.button(words("run_from"), self._run, color="green", needs="move")
        kit.button(words("one_step"), lambda: self._teaching.step(self._first()), color="teal", needs="move")
        self.pause = kit.button(words("pause"), self._teaching.pause, color="orange")
        self.resume = kit.button(words("resume"), self._teaching.resume, color="green")
        kit.reasons(move=words("run_from"))
        with gui.add_folder(words("edit")):
            self.form = NewStep(kit)
            kit.button(words("add_step"), self._add, color="green")
            kit.button(
                words("change_step"), lambda: self._teaching.change(self._chosen(), self.form.make()), color="gray"
            )
            kit.button(words("step_up"), lambda: self._shift(-1), color="gray")
            kit.button(words("step_down"), lambda: self._shift(1), color="gray")
            kit.button(words("delete_step"), lambda: self._teaching.delete(self._chosen()), color="orange")
        with gui.add_folder(words("file"), expand_by_default=False):
            kit.button(words("export"), self._export, color="gray")
            kit.button(words("remove_program"), lambda: self._teaching.remove(self._teaching.program.name), color="red")

    def refresh(self, readings: Readings) -> None:
        """The steps with what their check and the run say of them."""
        teaching, words = self._teaching, self._kit.words
        self.form.refresh()
        version, state = teaching.version, teaching.state  # in this order: what changes meanwhile is shown next time
        set_if_new(self.pause, "visible", state is not None and state.status is RunStatus.RUNNING)
        set_if_new(self.resume, "visible", state is not None and state.status is RunStatus.PAUSED)
        files = tuple(teaching.programs)  # also those that an editor or the command line has written
        if (version, files) == (self._version, self._files):
            return
        self._version, self._files = version, files
        if tuple(self.file.options) != (words("none"), *files):
            self.file.options = (words("none"), *files)
        self._show_open()
        self._show_steps()
        set_if_new(self.state, "content", self._state_text(state))
        set_if_new(self.steps, "content", self._list_text(state))

    def _show_steps(self) -> None:
        """The list to choose from; the chosen place stays where it can."""
        chosen = self._paths.get(str(self.step.value), ())
        steps = self._teaching.program.all_steps()
        self._paths = {self._kit.words("whole_program"): ()}
        self._paths |= {f"{path_text(path)}  {step_text(step, self._kit.words)}"[:60]: path for path, step in steps}
        options = tuple(self._paths)
        if tuple(self.step.options) != options:
            self.step.options = options
        kept = next((text for text, path in self._paths.items() if path == chosen), options[0])
        set_if_new(self.step, "value", kept)

    def _state_text(self, state: RunState | None) -> str:
        teaching, words = self._teaching, self._kit.words
        saved = "" if teaching.is_saved else note(esc(words("not_saved")))
        if teaching.is_checking:
            return saved + box(esc(words("checking")), "#1c7ed6")
        return saved + self._run_text(state) + self._check_text(teaching.check)

    def _run_text(self, state: RunState | None) -> str:
        if state is None:
            return ""
        words = self._kit.words
        return box(f"<b>{esc(words(f'run_{state.status.value}'))}</b> {esc(self._why(state))}", COLORS[state.status])

    def _why(self, state: RunState) -> str:
        """Why it has failed, paused or stopped, and in which step."""
        words, step = self._kit.words, path_text(state.step)
        if state.failure is not None:
            text = words.problem(problem_of(state.failure))[1]
            return words("at_step", step=step, text=text) if step else text
        if state.status is RunStatus.STOPPED and step:
            return words("in_step", step=step)
        return words.why(state.why) if state.why is not None else ""

    def _check_text(self, check: ProgramCheck | None) -> str:
        if check is None:
            return ""
        words = self._kit.words
        notes = [note for leg in check.legs for note in leg.notes]
        notes += [check.left_out] if check.left_out is not None else []
        told = [words.why(mistake.reason) for mistake in check.mistakes]
        for leg in check.legs:
            if leg.refusal is not None:
                text = words.problem(problem_of(leg.refusal))[1]
                told.append(words("at_step", step=path_text(leg.path), text=text))
        if check.ok:
            told.append(words("check_ok", duration=f"{check.duration:.1f}"))
        said = box("<br>".join(map(esc, told)), "#2f9e44" if check.ok else "#e03131")
        return said + note("<br>".join(dict.fromkeys(esc(words.why(each)) for each in notes)))

    def _list_text(self, state: RunState | None) -> str:
        teaching = self._teaching
        legs = {path: leg for leg in (teaching.check.legs if teaching.check is not None else ()) for path in leg.paths}
        lit = state.steps if state is not None and not state.status.is_over else ()
        rows = [
            self._row(path, step_text(step, self._kit.words), legs.get(path), path in lit)
            for path, step in teaching.program.all_steps()
        ]
        return f'<div style="margin:0 0.8em 0.6em;font-size:0.82em">{"".join(rows)}</div>' if rows else ""

    def _row(self, path: StepPath, text: str, leg: CheckedLeg | None, is_lit: bool) -> str:
        """One step: indented in its repeat, lit while it is carried out, with its time and tightest margin."""
        about = ""
        if leg is not None and leg.refusal is not None:
            name = self._kit.words.check(leg.refusal.check) or leg.refusal.check
            about = f'<span style="color:#e03131">✗ {esc(name)}</span>'
        elif leg is not None and leg.duration:
            joint, margin = leg.tightest
            about = f"{leg.duration:.2f} s"
            if joint:
                about += f" · {esc(joint)} {100 * margin:.0f} % {esc(self._kit.words('left'))}"
        style = "background:#2f9e4444;font-weight:bold;" if is_lit else ""
        indent = 0.3 + 1.1 * (len(path) - 1)
        return (
            f'<div style="{style}padding:1px 4px 1px {indent}em;border-bottom:1px solid #8883;display:flex;'
            f'justify-content:space-between"><span>{path_text(path)}&nbsp; {esc(text)}</span><span>{about}</span></div>'
        )

    def open(self) -> None:
        """The chosen program, once a person has said what becomes of unsaved steps."""
        chosen = str(self.file.value)
        if chosen in self._teaching.programs and chosen != self._teaching.program.name:
            self._leave(lambda: self._teaching.open(chosen))
        self._show_open()
        set_if_new(self.name, "value", self._teaching.program.name)

    def _show_open(self) -> None:
        """Chooses the program that is open: one that could not be opened is not."""
        name = self._teaching.program.name
        set_if_new(self.file, "value", name if name in self._teaching.programs else self._kit.words("none"))

    def new(self) -> None:
        """An empty one with the name in the field; asks as `open` does."""
        name = str(self.name.value)
        self._leave(lambda: self._teaching.new(name))

    def _leave(self, action: Callable[[], object]) -> None:
        """Does it; where that would lose steps that are not saved, once a person has said what becomes of them."""
        teaching, words = self._teaching, self._kit.words

        def go_on() -> None:
            if self._operator.guarded(action):
                set_if_new(self.name, "value", teaching.program.name)

        if teaching.is_saved or not teaching.program.steps:
            return go_on()
        name = teaching.program.name
        with self._kit.gui.add_modal(words("not_saved")) as modal:
            self._kit.line(note(esc(words("unsaved_question", name=name))))

            def save() -> None:
                modal.close()
                if self._operator.guarded(lambda: teaching.save(name)):
                    go_on()

            def discard() -> None:
                modal.close()
                go_on()

            self._kit.button(words("save_first"), save, color="blue")
            self._kit.button(words("discard"), discard, color="orange")
            self._kit.button(words("cancel"), modal.close, color="gray")
        return None

    def _chosen(self) -> StepPath:
        path = self._first()
        if not path:
            raise gemelo.BadArgument(self._kit.words("choose_step"))
        return path

    def _first(self) -> StepPath:
        """The chosen step; empty for the program's beginning."""
        return self._paths.get(str(self.step.value), ())

    def _check(self) -> None:
        self._teaching.plan_all()

    def _run(self) -> None:
        self._operator.forget_problem()
        self._teaching.start(self._first())

    def _add(self) -> None:
        after = self._first()
        place = self._teaching.insert(self.form.make(), after)
        self._choose(place if after else ())

    def _shift(self, by: int) -> None:
        self._choose(self._teaching.shift(self._chosen(), by))

    def _choose(self, path: StepPath) -> None:
        self._show_steps()
        text = next((text for text, each in self._paths.items() if each == path), None)
        if text is not None:
            set_if_new(self.step, "value", text)

    def _export(self) -> None:
        text = export_script(self._teaching.program, self._teaching.points, self._teaching.programs)
        self._kit.client.send_file_download(f"{self._teaching.program.name}.py", text.encode())
