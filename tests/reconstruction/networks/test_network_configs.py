"""The networks' configurations refuse bad numbers, and come back from files, old ones included."""

import dataclasses
import json

import numpy as np
import pytest
from shapes import make_sheet

from reconstruction import GrowingGridConfig, GSRMConfig, Reconstruction, ReconstructionError, reconstruct
from reconstruction._src.networks.least_squares import FitConfig
from reconstruction._src.networks.som.compilation import keep_compiled_programs
from reconstruction._src.networks.som.density import DensityConfig

keep_compiled_programs()


@pytest.mark.parametrize("config", [GSRMConfig(), GrowingGridConfig()])
def test_a_configuration_is_hashable_and_equal_to_its_like(config):
    assert hash(config) == hash(dataclasses.replace(config))
    assert config != dataclasses.replace(config, density=DensityConfig(near=9.0))


@pytest.mark.parametrize(
    ("config", "field"),
    [
        (DensityConfig, "near"),
        (FitConfig, "reach"),
        (GSRMConfig, "coarse_samples"),
        (GrowingGridConfig, "reach"),
    ],
)
def test_a_number_that_makes_no_sense_is_refused_by_name(config, field):
    for wrong in (-1, 0, float("nan")):
        with pytest.raises(ReconstructionError, match=rf"{config.__name__}\.{field} must be above 0, got"):
            config(**{field: wrong})


def test_nested_configurations_come_back_from_a_file(tmp_path):
    options = {"density": DensityConfig(near=9.0)}
    surface = reconstruct(make_sheet(1500), units=40, **options)
    surface.save(tmp_path / "surface.npz")
    loaded = Reconstruction.load(tmp_path / "surface.npz")
    assert loaded.config == surface.config
    assert hash(loaded.config) == hash(surface.config)


@pytest.mark.parametrize("method", ["gsrm", "gg"])
def test_a_file_from_before_the_nested_configurations_is_read(tmp_path, method):
    surface = reconstruct(make_sheet(1500), method, units=40)
    surface.save(tmp_path / "surface.npz")
    with np.load(tmp_path / "surface.npz") as file:
        arrays = dict(file)
    header = json.loads(str(arrays["header"]))
    header["config"] = {
        name: value for name, value in header["config"].items() if not isinstance(value, dict)
    }
    arrays["header"] = np.array(json.dumps(header))
    np.savez(tmp_path / "old.npz", **arrays)
    assert Reconstruction.load(tmp_path / "old.npz").config == surface.config
