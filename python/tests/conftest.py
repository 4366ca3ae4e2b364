"""The built-in subject as a data set, and an avatar that was trained on it for a few steps: made once."""

import pytest

import xavatar

#: Far too little for a good avatar, and enough for a surface.
SETTINGS = {"schedule.pretraining_steps": 20, "schedule.checkpoint_steps": 10, "sampling.points": 600}


@pytest.fixture(scope="session")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data") / "mannequin"
    xavatar.write_built_in_subject(folder, 3, 1)
    return folder


@pytest.fixture(scope="session")
def trained(data, tmp_path_factory):
    """The run's folder, and the events of its training."""
    run, events = tmp_path_factory.mktemp("runs") / "run", []
    xavatar.train(data, data / "body", run, preset="demo", steps=12, settings=SETTINGS, callback=events.append)
    return run, events


@pytest.fixture(scope="session")
def avatar(trained):
    return xavatar.load(trained[0])


@pytest.fixture(scope="session")
def body(data):
    return xavatar.Body.load(data / "body")
