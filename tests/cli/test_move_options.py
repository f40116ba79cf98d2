"""The planner's request from the options of `gemelo move`."""

import math
from pathlib import Path

import pytest

from gemelo.api.arguments import Target
from gemelo.api.targets import not_connected, request_of, usual_time
from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.planning import (
    CircularMotion,
    FreeMotion,
    JointGoal,
    LinearMotion,
    NamedGoal,
    PlanRequest,
    PointToPoint,
    PoseGoal,
    WaypointGoal,
)
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.main import parse
from gemelo.tools.cli.motion.move import EXAMPLES
from gemelo.tools.cli.motion.move_report import MoveReport, summary
from gemelo.tools.cli.motion.move_request import ARGUMENTS, OF_MOVE, request_from

ARM = load_arm(Path(__file__).parents[2] / "urdf/rm1")


def request(words: str) -> PlanRequest:
    return request_from(parse(["move", *words.split()]), ARM)


def test_without_a_way_any_will_do():
    assert request("--named ready") == PlanRequest(goal=NamedGoal(name="ready"), allowed_time=usual_time(0))


def test_a_line_has_the_tools_speed_in_metres():
    asked = request("--to 0.2 0.1 0.1 --line --tool-speed 50mm/s --tool-acceleration 200mm/s2 --fraction 50%")
    assert asked.goal == PoseGoal(position=(0.2, 0.1, 0.1))
    assert asked.motion == LinearMotion(speed=0.05, acceleration=0.2, least_fraction=0.5)


def test_an_arc_has_a_point_or_a_centre():
    assert request("--to 0.2 0.1 0.1 --arc 0.2 0 0.1").motion == CircularMotion(interim=(0.2, 0.0, 0.1))
    assert request("--to 0.2 0.1 0.1 --center 0.2 0 0.1").motion == CircularMotion(center=(0.2, 0.0, 0.1))


def test_points_before_the_goal_are_turned_as_it_is():
    asked = request("--via 0.1 0 0.1 --via 0.1 0.1 0.1 --to 0.2 0.1 0.1 --rpy 180deg 0 90deg --blend 10mm --ptp")
    turn = from_rpy(math.pi, 0.0, math.pi / 2)
    places = ((0.1, 0.0, 0.1), (0.1, 0.1, 0.1), (0.2, 0.1, 0.1))
    assert asked.goal == WaypointGoal(
        points=tuple(PoseGoal(position=place, orientation=turn) for place in places), blend=0.01
    )
    assert asked.motion == PointToPoint()


def test_points_may_lie_before_joints_too():
    asked = request("--via 0.1 0 0.1 --joints brazo_joint=0.5rad")
    goal = JointGoal(name=("brazo_joint",), position=(0.5,))
    assert asked.goal == WaypointGoal(points=(PoseGoal(position=(0.1, 0.0, 0.1)), goal))


def test_the_tool_points_along_a_direction():
    asked = request("--to 0.2 0.1 0.1 --along 0 0 -1 --frame brazo_link")
    assert asked.goal == PoseGoal(
        position=(0.2, 0.1, 0.1), tool_axis=(0.0, 0.0, 1.0), direction=(0.0, 0.0, -1.0), frame="brazo_link"
    )


def test_a_free_motion_names_its_planner_and_seed():
    asked = request("--named left --planner RRTstar --seed 7 --time 3")
    assert asked.motion == FreeMotion(planner_id="RRTstar", seed=7)
    assert request("--named left --attempts 20").motion == FreeMotion(attempts=20)
    assert asked.allowed_time == 3.0


def test_a_clearance_is_a_length_within_its_range():
    assert request("--named left --clearance 1.5mm").clearance == 0.0015
    assert request("--named left --clearance 0.5mm").clearance == 0.0005


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--named left --clearance 0.4mm", "--clearance 0.4mm is not from 0.5mm to 50mm"),
        ("--named left --clearance 4", "--clearance 4000mm is not from 0.5mm to 50mm"),
        ("--named left --attempts 0", "--attempts 0 is not from 1 to 1000"),
        ("--to 0.2 0.1 0.1 --line --attempts 3", "--attempts does not go with --line"),
        ("--named left --rpy 0 0 0", "--rpy does not go with --named"),
        ("--to 0.2 0.1 0.1 --blend 10mm", "--blend does not go with a goal without --via"),
        ("--to 0.2 0.1 0.1 --tool-speed 10", "--tool-speed does not go with a free motion"),
        (
            "--to 0.2 0.1 0.1 --fraction 50%",
            r"--fraction .* a free motion \(only --line, --arc and --center\)",
        ),
        ("--named ready --ptp --max-step 2mm", "--max-step does not go with a ptp motion"),
        ("--to 0.2 0.1 0.1 --line --max-step 0", "--max-step 0mm is not above 0"),
        ("--to 0.2 0.1 0.1 --line --planner PRM", "--planner does not go with --line"),
        ("--to 0.2 0.1 0.1 --line --tool-speed 0", "--tool-speed 0mm/s is not above 0"),
        ("--via 0.1 0 0.1 --to 0.2 0.1 0.1 --blend -3", "--blend -3000mm is not above 0"),
        ("--via 0.1 0 0.1 --to 0.2 0.1 0.1 --arc 0.2 0 0.1", "--arc does not go with --via"),
        ("--named left --time 0", "--time 0s is not above 0"),
        ("--named left --time 4000", "--time 4000s is more than 3600s"),
        ("--named redy", 'no named state "redy"; did you mean "ready"'),
        ("--to 0.2 0.1 0.1 --frame brazo", 'no link "brazo"; did you mean "brazo_link"'),
        ("--to 0.2 0.1 0.1 --axis 0 0 1", "--axis is an axis of the tool: say with --along in which direction"),
        ("--to 0.2 0.1 0.1 --rpy 0 0 0 --along 0 0 1", "say how the tool is turned once, not by --rpy and --along"),
        ("--to 0.2 0.1 0.1 --quaternion 1 1 0 0", "--quaternion is a quaternion of length 1.4142, not 1"),
        ("--to 0.2 0.1 12000mm", "--to has 12 m: if it is in millimetres, write 12mm"),
        ("--joints brazo_joint=30rad", "if it is in degrees, write 30deg"),
    ],
)
def test_what_does_not_go_together_is_refused_by_name(words: str, said: str):
    with pytest.raises(CommandError, match=said):
        request(words)


@pytest.mark.parametrize(
    "words", ["--to 1 2 3 --line --ptp", "--to 1 2 nan --line", "--to 1 2 3 --tool-speed inf --line"]
)
def test_two_ways_at_once_and_what_is_no_number_end_with_two(words: str):
    with pytest.raises(SystemExit) as ended:
        parse(["move", *words.split()])
    assert ended.value.code == 2


def test_every_example_of_the_help_can_be_typed():
    lines = [line.split("gemelo move ")[1] for line in EXAMPLES.splitlines() if "gemelo move" in line]
    assert len(lines) == 9
    for line in lines:
        if "--execute" not in line:
            assert request(line.split(" >")[0]).velocity_scaling > 0.0


def test_a_line_that_stops_short_says_so():
    report = MoveReport(
        robot="rm1", planned_s=0.005, duration_s=2.0, fraction=0.5, stopped_by="at 0.1 m of 0.2 m, the crate"
    )
    assert summary(report, ARM, plan_only=True) == (
        "planned in 5.0 ms 50.0% of the way (at 0.1 m of 0.2 m, the crate), would take 2.00 s"
    )


def test_lengths_and_turns_take_the_units_that_scenes_take():
    plain = request("--via 0.1 0 0.1 --to 0.2 0.1 -0.1 --rpy 3.141592653589793rad 0 -1.5707963267948966rad --line")
    assert request("--via 100mm 0 0.1m --to 200mm 0.1 -100mm --rpy 180deg 0 -90deg --line") == plain
    radians = request("--to 0.2 0.1 -0.1 --rpy 3.141592653589793rad 0 0").goal
    assert radians.orientation == pytest.approx(request("--to 0.2 0.1 -0.1 --rpy 180deg 0 0").goal.orientation)


@pytest.mark.parametrize("words", ["--to 1deg 0 0", "--to 0.1 0 0 --rpy 1mm 0 0", "--to far 0 0", "--to 0 0 nan"])
def test_what_is_no_length_or_turn_is_refused(words, capsys):
    with pytest.raises(SystemExit):
        request(words)
    assert "argument --" in capsys.readouterr().err


def test_the_options_and_the_arguments_are_one_request():
    options = "--via 0.1 0 0.1 --to 0.2 0.1 0.1 --along 0 0 -1 --line --tool-speed 50mm/s --speed 50% --clearance 2mm"
    arguments = Target(
        via=[(0.1, 0.0, 0.1)], position=(0.2, 0.1, 0.1), along=(0.0, 0.0, -1.0), line=True, tool_speed=0.05, speed=0.5,
        clearance=0.002,
    )  # fmt: skip
    assert request(options) == request_of(ARM, arguments, not_connected)


def test_every_argument_has_an_option_but_those_of_a_program():
    """`pose`, `offset` and `from_joints` are for what a program knows; tolerances are of `gemelo ik` alone."""
    options = vars(parse(["move", "--named", "ready"]))
    missing = {name for name in ARGUMENTS if OF_MOVE.get(name, name) not in options}
    assert missing == {
        "pose", "offset", "from_joints", "acceleration", "position_tolerance", "orientation_tolerance",
    }  # fmt: skip
