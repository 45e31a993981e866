"""``glovecal train`` leaves a dead sensor out and says so; ``--keep-dead`` refuses it."""

from dataclasses import replace

from cli_running import simulated

from glovecal_models.takes.write_table import write_takes


def test_a_dead_sensor_is_left_out_or_refused(run, tmp_path):
    take = simulated("key_poses", "poses")
    readings = take.readings.copy()
    readings[:, take.sensors.index("R_PIP")] = 121.0
    write_takes([replace(take, readings=readings)], tmp_path / "dead.csv")
    run("subject", "add", "anna")
    assert run("take", "import", tmp_path / "dead.csv", "-s", "anna").code == 0
    trained = run("train", "-s", "anna", "--method", "linear")
    assert trained.code == 0, trained.err
    assert "Dead sensor in these takes: R_PIP (always 121)." in trained.said
    assert "No working sensor measures R_PIP, R_DIP: not in the model." in trained.said
    refused = run("train", "-s", "anna", "--method", "linear", "--keep-dead")
    assert refused.code == 1
    assert "sensor R_PIP reads 121 in all" in refused.said
