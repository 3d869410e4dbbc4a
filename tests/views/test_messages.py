"""Messages of invalid films, figures, exports and reports; `messages.yml` holds all."""

from antdrive.sim.log.record import ComponentRecord
from antdrive.views.export.exporting import export
from antdrive.views.figures.run_figures import overview
from antdrive.views.film.video import film, still
from antdrive.views.pages.campaign_summary import summarise
from antdrive.views.pages.report import Report, write_report
from tests.messages import check_messages
from tests.records import changed
from tests.runs.made_up_campaign import Skill, made_up_runs

FILMS = (
    ("a.avi", {}), ("a", {}), ("a.mp4", {"camera": "side"}), ("a.mp4", {"size": (321, 240)}), ("a.mp4", {"size": (32, 24)}),
    ("a.mp4", {"fps": 0}), ("a.mp4", {"speed": -1}),
)  # fmt: skip
PLANNERS = (("astar", {}), ("as", {"time_budget": 1.0}), ("nobody", {}))
EXPORTS = (("ros1", "bag"), ("mcap", "drive.bag"), ("csv", "drive.csv"), ("rosbag2", "drive.mcap"))
RESULTS = ("{", "[]", "[" * 100_000, '{"seed": ' + "9" * 5000 + "}", "{" + " " * 10_000_001)


def test_invalid_films_figures_exports_and_reports_are_rejected_in_one_line(made_up_drive, tmp_path, data_regression):
    def preluded(name, settings):
        other = changed(drive, "record", planner=ComponentRecord(name=name, settings=settings))
        film(other, out / "a.mp4", prelude=1.0)

    def reported(name, content):
        folder = tmp_path / "runs"
        folder.mkdir(exist_ok=True)
        for old in folder.iterdir():
            old.unlink()
        (folder / name).write_text(content)
        write_report(folder, out / "report.html")

    drive, out = made_up_drive(), tmp_path / "out"
    out.mkdir()
    log, runs = drive.save(tmp_path / "rollout.npz"), made_up_runs({"a": Skill()}, worlds=2, seeds=2)
    calls = {
        "films": {f"{name} {given}": lambda n=name, g=given: film(drive, out / n, **g) for name, given in FILMS},
        "stills": {
            "a.jpg": lambda: still(drive, out / "a.jpg"),
            "beyond the end": lambda: still(drive, out / "a.png", 99.0),
        },
        "comparisons": {str(n): lambda n=n: film(dict.fromkeys("abcdefg"[:n], drive), out / "c.mp4") for n in (0, 7)},
        "preludes": {name: lambda n=name, s=settings: preluded(n, s) for name, settings in PLANNERS},
        "figures": {"a.bmp": lambda: overview(drive, out / "a.bmp")},
        "exports": {f"{to} {name}": lambda t=to, n=name: export(log, t, out / n) for to, name in EXPORTS},
        "reports": {
            **{
                f"{content[:9]}, {len(content)} long": lambda c=content: reported("result.json", c)
                for content in RESULTS
            },
            "no runs": lambda: reported("other", ""),
            "nothing": lambda: write_report([], out / "report.html"),
            "a.pdf": lambda: write_report(tmp_path, out / "a.pdf"),
        },
        "campaigns": {
            "one planner": lambda: summarise(runs, title="t", strict=True),
            "no metric": lambda: summarise(runs, title="t", metrics=["speed"]),
            "t.pdf": lambda: Report.of(summarise(runs, title="t"), tmp_path).write(out / "t.pdf"),
        },
    }
    check_messages(calls, data_regression, tmp_path)
    assert not list(out.iterdir()), "refused before anything is written"
