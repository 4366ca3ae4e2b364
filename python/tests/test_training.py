"""Training, registering and measuring: what callbacks hear, how they stop, what is raised."""

import os
import signal
import threading

import numpy
import pytest

import xavatar
from conftest import SETTINGS


def train(data, run, steps=12, **options):
    return xavatar.train(data, data / "body", run, preset="demo", steps=steps, settings=SETTINGS, **options)


def test_the_callback_hears_every_step(trained):
    _, events = trained
    steps = [event for event in events if event.kind == "step" and event.stage == "frames"]
    assert [event.step for event in steps] == list(range(1, 13))
    assert all(event.losses["total"] > 0 for event in steps)
    assert steps[-1].progress == pytest.approx(1.0)
    assert any(event.kind == "checkpoint" and event.path.exists() for event in events)


def test_an_exception_of_the_callback_stops_and_the_same_call_goes_on(data, trained, tmp_path):
    class Enough(Exception):
        pass

    def stop(event):
        if event.kind == "step" and event.stage == "frames" and event.step == 5:
            raise Enough

    with pytest.raises(Enough):
        train(data, tmp_path / "run", callback=stop)
    avatar = train(data, tmp_path / "run")
    whole = xavatar.load(trained[0])
    assert avatar.steps == 12
    same = numpy.array_equal(avatar.canonical(32).vertices, whole.canonical(32).vertices)
    assert same, "a run that was stopped ends with the same bits"


def test_interrupts_stop_training_at_a_checkpoint(data, tmp_path):
    def interrupt(event):
        if event.kind == "step" and event.stage == "frames" and event.step == 3:
            threading.Thread(target=os.kill, args=(os.getpid(), signal.SIGINT)).start()

    # Jobs in the background begin with interrupts ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            train(data, tmp_path / "run", steps=100_000, callback=interrupt)
    finally:
        signal.signal(signal.SIGINT, before)
    assert any((tmp_path / "run" / "checkpoints").iterdir())


def test_other_threads_run_while_it_trains(data, tmp_path):
    ticks, done = [], threading.Event()

    def tick():
        while not done.wait(0.002):
            ticks.append(1)

    thread = threading.Thread(target=tick)
    thread.start()
    steps_at = []
    train(data, tmp_path / "run", callback=lambda event: steps_at.append(len(ticks)))
    done.set()
    thread.join()
    assert steps_at[-1] > steps_at[0], "the interpreter's lock is free during the steps"


def test_metrics_are_the_command_line_s(data, trained):
    events = []
    metrics = xavatar.evaluate(trained[0], data, data / "body", resolution=48, callback=events.append)
    assert metrics["frames"] == 1 and metrics["mean"]["all"]["cd_mm"] > 0
    assert [event.message for event in events] == ["test/Take2/f00001"]


def test_frames_are_scans_with_their_poses(data, body):
    subject = xavatar.Subject.open(data, body)
    names = subject.frames("train")
    assert names == [f"train/Take1/f{number:05}" for number in (1, 2, 3)]
    frame = subject[names[1]]
    posed = body.forward(frame.pose.rotations[None], translations=frame.pose.translation[None])
    gap = numpy.abs(posed.vertices[0].max(axis=0) - frame.mesh.vertices.max(axis=0))
    assert gap.max() < 0.1, "the body lies in its scan"
    assert subject.check()["problems"] == []
    with pytest.raises(xavatar.ArgumentError, match="a frame is nowhere"):
        subject["nowhere"]


def test_remedies_are_in_the_words_of_a_caller(data, tmp_path):
    broken = tmp_path / "broken"
    xavatar.write_built_in_subject(broken, 2, 1)
    scan = next((broken / "train").glob("*/meshes_ply/*.ply"))
    scan.write_bytes(scan.read_bytes()[:1000])
    with pytest.raises(xavatar.Error) as caught:
        train(broken, tmp_path / "run")
    assert caught.value.frame.startswith("train/Take1/f")
    scan.unlink()
    with pytest.raises(xavatar.MissingError, match=r"skip_bad_frames=True") as caught:
        train(broken, tmp_path / "run")
    assert caught.value.remedy == "train(..., skip_bad_frames=True)"
    with pytest.raises(xavatar.ArgumentError, match="did you mean `sampling.points`"):
        xavatar.train(data, data / "body", tmp_path / "other", settings={"sampling.point": 1})


def test_registering_stops_when_it_is_told_to(data, tmp_path):
    scans, events = tmp_path / "scans", []
    scans.mkdir()
    for path in sorted((data / "train").glob("*/meshes_ply/*.ply")):
        (scans / path.name).write_bytes(path.read_bytes())

    def stop(event):
        events.append(event)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        xavatar.register(scans, data / "body", tmp_path / "registered", callback=stop)
    assert len(events) == 1 and events[0].kind == "starts"
