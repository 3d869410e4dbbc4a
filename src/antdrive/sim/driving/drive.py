"""The drive loop: control periods until the drive ends, with every physics step logged."""

from __future__ import annotations

from collections.abc import Callable

from antdrive.base.errors import FieldError
from antdrive.robots import Avoidance, NoiseModel, PurePursuit, TrackedPath, Twist
from antdrive.sim.driving.caution import Caution
from antdrive.sim.driving.driver import Driver
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.localising import OdometryModel
from antdrive.sim.driving.lookout import Lookout
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.recorder import Drive, Ending, Recorder
from antdrive.sim.driving.replanning import ReplanMonitor
from antdrive.sim.driving.survey import Survey
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import Task

AFTER_CONTACT = 0.5  # after a collision the robot brakes for this long in the log [s]
PROGRESS_HZ = 10  # calls of `progress` per simulated second


def drive(
    engine: Engine,
    controller: PurePursuit,
    tracked: TrackedPath,
    task: Task,
    *,
    control_hz: int = 60,
    time_limit: float,
    noise_model: NoiseModel | None = None,
    avoidance: Avoidance | None = None,
    predictor: Predictor | None = None,
    monitor: ReplanMonitor | Exploration | None = None,
    caution: Caution | None = None,
    lookout: Lookout | None = None,
    progress: Callable[[float], None] | None = None,
) -> Drive:
    """Drive along a path until the robot stands at its end, touches something, is stuck, or the time is over.

    Raises:
        ValueError: the control rate does not divide the physics rate.
    """
    substeps, rest = divmod(engine.physics_hz, control_hz)
    if rest or substeps < 1:
        raise FieldError("control_hz", f"must divide the physics rate {engine.physics_hz}, got {control_hz}")
    driver = Driver(controller, tracked, task, engine.robot, control_hz, avoidance, predictor, monitor, caution)
    survey = monitor.survey if isinstance(monitor, Exploration) else lookout
    log = Recorder(engine, task.start, noisy=noise_model is not None)
    ending = Ending(Outcome.COLLIDED) if log.touched else None
    tick = 0
    for tick in range(round(time_limit * control_hz)):
        if ending:
            break
        ending = _control_period(tick, engine, driver, log, noise_model, survey, substeps)
        if progress is not None and tick % (control_hz // PROGRESS_HZ or 1) == 0:
            progress(driver.fraction)
    if log.touched:
        engine.command(0.0, 0.0)
        log.advance(round(AFTER_CONTACT * engine.physics_hz), Twist(0.0, 0.0), driver.pursuit.limiter)
    return log.finish(_explained(ending or Ending(Outcome.TIMED_OUT), monitor, tick))


def _explained(ending: Ending, monitor: ReplanMonitor | Exploration | None, tick: int) -> Ending:
    """How the drive ends; where a robot without a map did not get on, whether it had found no way."""
    if not isinstance(monitor, Exploration) or ending.outcome not in (Outcome.STUCK, Outcome.TIMED_OUT):
        return ending
    return Ending(ending.outcome, "; ".join(filter(None, (ending.reason, monitor.no_way(tick)))))


def _control_period(
    tick: int,
    engine: Engine,
    driver: Driver,
    log: Recorder,
    noise_model: NoiseModel | None,
    survey: Survey | Lookout | None,
    substeps: int,
) -> Ending | None:
    """Sense, decide, act and log for one control period; how the drive ends in it, if it does."""
    pose = log.state.pose
    if noise_model:
        estimate = noise_model.estimate_pose(pose, Twist(log.state.speed, log.state.yaw_rate))
        if survey:
            estimate = survey.look(tick, pose, estimate)
            if isinstance(noise_model, OdometryModel):
                noise_model.correct(estimate)
        log.note_estimate(estimate)
        pose = noise_model.pose_after_delay()
    elif survey:
        survey.look(tick, pose, pose)
    ending = driver.decide(tick, pose, log.state)
    if ending:
        return ending
    actuated = noise_model.actuate(driver.command) if noise_model else driver.command
    engine.command(*actuated)
    log.advance(substeps, driver.command, driver.pursuit.limiter, actuated)
    if log.touched:
        return Ending(Outcome.COLLIDED)
    if driver.stuck:
        return Ending(Outcome.STUCK, driver.why_stuck)
    return None
