"""Rules, flight models and recommended parameters read one table for each vehicle."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faao_mav.autopilot import (
    ARDUCOPTER,
    Vehicle,
    VehicleType,
    families,
    vehicle_type,
    vehicle_type_by_numbers,
    vehicle_types,
)
from faao_mav.autopilot.files import autopilot_of
from faao_mav.autopilot.parameter import Parameter
from faao_mav.errors import InputError
from faao_mav.mission.item import Mission
from faao_mav.validate.context import ValidationContext

PARAMETERS = [(each, one) for each in vehicle_types() for one in each.parameters.values()]
UNITS = {"", "m", "s", "rad", "m/s", "m/s^2", "m/s^3", "1/s", "1/s^2", "rad/s", "rad/s^2"}


def bare(each: VehicleType, parameters: dict[str, float] | None = None) -> Vehicle:
    return Vehicle(each.family.key, each.kind, parameters or {})


def test_every_record_is_whole_set_by_its_names_and_holds_what_is_recommended() -> None:
    for each, parameter in PARAMETERS:
        said, value = f"{each.name} {parameter.key}", parameter.default * 0.8 or 1.0
        value = value if value >= parameter.least else parameter.default * 1.25
        assert parameter.unit in UNITS, said
        assert parameter.least <= parameter.default <= parameter.greatest, said
        assert all(name.isupper() and len(name) <= 16 for name in parameter.names), said
        assert not parameter.capped_by or parameter.capped_by in each.parameters, said
        assert bare(each).value(parameter.key) == pytest.approx(parameter.default), said
        for name, factor in parameter.names.items():
            vehicle = bare(each, {name: value / factor})
            judged = ValidationContext(Mission(()), vehicle).vehicle
            assert judged.value(parameter.key) == pytest.approx(value), name
            assert vehicle.name_of(parameter.key) == name
            if each.flight_model is not None:
                model = vehicle.flight_model()
                assert getattr(model, parameter.key, value) == pytest.approx(value), name
    for each in vehicle_types():
        if each.flight_model is not None:
            assert bare(each).flight_model() == type(bare(each).flight_model())()
        known = {name: p for p in each.parameters.values() for name in p.names}
        for parameters in each.recommended(8.0, 1.5):
            assert set(parameters) <= set(known)
            for name, number in parameters.items():
                assert known[name].is_usable(number, name)


@given(st.sampled_from(PARAMETERS), st.floats(allow_nan=True, allow_infinity=True))
def test_a_value_is_usable_or_named_in_an_error(
    which: tuple[VehicleType, Parameter], number: float
) -> None:
    each, parameter = which
    name = parameter.newest_name
    vehicle = bare(each, {name: number})
    try:
        assert math.isfinite(vehicle.value(parameter.key))
        assert vehicle.usable() == vehicle
    except InputError as error:
        assert f"parameters: {name}: " in str(error)
        assert vehicle.usable().parameters == {}


def test_the_newest_name_counts_a_cap_lowers_it_and_names_tell_whose_they_are() -> None:
    both = Vehicle(parameters={"WPNAV_ACCEL": 400, "WP_ACC": 3.0})
    assert (both.value("acceleration"), both.name_of("acceleration")) == (3.0, "WP_ACC")
    capped = Vehicle("px4", parameters={"MPC_Z_V_AUTO_UP": 4, "MPC_Z_VEL_MAX_UP": 2})
    assert (capped.value("climb_speed"), capped.name_of("climb_speed")) == (2, "MPC_Z_VEL_MAX_UP")
    for names, whose in (
        (["WPNAV_SPEED"], "ardupilot"),
        (["WP_SPD", "RTL_ALT"], "ardupilot"),
        (["RTL_RETURN_ALT", "MPC_XY_CRUISE"], "px4"),
        (["NAV_ACC_RAD"], "px4"),
        (["RTL_ALT"], None),
        (["MPC_XY_CRUISE", "WPNAV_SPEED"], None),
        ([], None),
    ):
        assert autopilot_of(names) == whose


def test_vehicles_are_found_by_name_and_number() -> None:
    assert len(vehicle_types()) == 4
    for each in vehicle_types():
        assert vehicle_type(each.family.key, each.kind) is each
        for number in each.mav_types:
            assert vehicle_type_by_numbers(each.family.mav_autopilot, number) is each
    assert len({each.mav_autopilot for each in families().values()}) == len(families())
    assert vehicle_type_by_numbers(3, None) is ARDUCOPTER
    assert vehicle_type_by_numbers(3, 10) is None
    with pytest.raises(InputError, match="betaflight copter is unknown; known are ardupilot"):
        _ = Vehicle("betaflight").type
