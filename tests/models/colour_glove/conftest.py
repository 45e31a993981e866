"""One small database for all tests of the look-up."""

import pytest

from glovecal_models.colour_glove.database import DatabaseSettings, PoseDatabase, pose_database
from glovecal_models.colour_glove.pattern import glove_pattern
from glovecal_models.colour_glove.pose_set import generated_poses
from glovecal_models.colour_glove.skin import hand_skin


@pytest.fixture(scope="session")
def database(tmp_path_factory: pytest.TempPathFactory) -> PoseDatabase:
    skin, folder = hand_skin(), tmp_path_factory.mktemp("database")
    settings = DatabaseSettings(entries=1500, configurations=150)
    return pose_database(skin, glove_pattern(skin), generated_poses(2000), folder, settings, workers=1)
