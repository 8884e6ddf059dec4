"""The figures say what they show, and show what the flight is."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MakePlan
from reported import flown

from faao_mav import optimize
from faao_mav.errors import InputError
from faao_mav.report import figures
from faao_mav.report.style import save_figure


def every() -> list[Any]:
    found = flown()
    solution, conversion, prediction = found.solution, found.conversion, found.prediction
    return [
        figures.flight_figure(solution, conversion, prediction),
        figures.flight_figure(solution),
        figures.route(solution, conversion),
        figures.motion(solution, conversion),
        figures.rates(solution, prediction),
        figures.precoder_power(solution),
        figures.convergence(solution),
    ]


def lines(axes: Any) -> dict[str, Any]:
    return {line.get_label(): line for line in axes.lines}


def test_every_plot_has_a_title_and_named_axes_with_units() -> None:
    for figure in every():
        for axes in figure.axes:
            if axes.get_label() == "<colorbar>":
                assert axes.get_ylabel() == "speed, m/s"
                continue
            assert axes.get_title("left")
            assert axes.get_xlabel()
            assert ", " in axes.get_ylabel()


def test_the_curves_are_the_flight() -> None:
    found = flown()
    solution = found.solution
    speed, acceleration = figures.motion(solution, found.conversion).axes
    planned = lines(speed)["planned"]
    np.testing.assert_array_equal(planned.get_xdata(), solution.t)
    np.testing.assert_array_equal(planned.get_ydata(), np.hypot(*solution.v.T))
    assert set(lines(speed)["v_max"].get_ydata()) == {solution.plan.vehicle.max_speed}
    assert set(lines(acceleration)["a_max"].get_ydata()) == {5.0}
    (rate,) = figures.rates(solution, found.prediction).axes
    np.testing.assert_array_equal(lines(rate)["to UAV, planned"].get_ydata(), solution.I_U)
    np.testing.assert_array_equal(
        lines(rate)["to user, predicted"].get_ydata(), found.prediction.I_G
    )


def test_streams_add_up_to_the_power_and_the_strongest_is_first() -> None:
    solution = flown().solution
    station, _ = figures.precoder_power(solution).axes
    first, second = (lines(station)[f"stream {k}"].get_ydata() for k in (1, 2))
    used = np.sum(np.abs(solution.P_B) ** 2, axis=(1, 2))
    np.testing.assert_allclose((first + second) / 1e3, used)  # in mW
    assert np.all(first >= second)


def test_precoders_for_every_draw_are_averaged(small_plan: MakePlan) -> None:
    changes = {
        "radio.csi": "instantaneous",
        "radio.fading_samples": 2,
        "optimizer.starts": ["straight"],
        "optimizer.max_iterations": 2,
    }
    solution = optimize(small_plan(changes))
    station, _ = figures.precoder_power(solution).axes
    total = sum(lines(station)[f"stream {k}"].get_ydata() for k in (1, 2))
    used = np.sum(np.abs(solution.P_B) ** 2, axis=(-2, -1)).mean(axis=0)
    np.testing.assert_allclose(total / 1e3, used)


def test_the_map_has_stations_waypoints_and_fence() -> None:
    found = flown()
    axes = figures.route(found.solution, found.conversion).axes[0]
    names = {text.get_text() for text in axes.texts}
    items = enumerate(found.conversion.mission.items, 1)
    numbers = {str(number) for number, item in items if item.command == 16}
    assert len(numbers) > 1
    assert names == {"base station", "user"} | numbers
    ring = next(line for line in axes.lines if line.get_linestyle() == "-" and
                len(line.get_xdata()) > 20)  # fmt: skip
    east, north = np.asarray(ring.get_xdata()), np.asarray(ring.get_ydata())
    np.testing.assert_allclose(np.ptp(east), 10.0, rtol=1e-3)
    np.testing.assert_allclose(north.mean(), 0.0002 * 110_950, rtol=0.05)  # m per degree


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_files_are_the_same_every_time(tmp_path: Path, suffix: str) -> None:
    written = []
    for name in ("a", "b"):
        path = tmp_path / f"{name}{suffix}"
        save_figure(figures.convergence(flown().solution), path)
        written.append(path.read_bytes())
    assert written[0] == written[1]


def test_other_formats_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"\.png, \.svg, \.pdf"):
        save_figure(figures.convergence(flown().solution), tmp_path / "f.gif")
