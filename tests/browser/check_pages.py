"""Pages in a real browser: Debian's Chromium, driven by Playwright, without a graphics card.

python -m pytest -n 0 tests/browser/check_pages.py
"""

import json
import os
import re
import shutil

import numpy as np
import pytest

import opl
from opl.cell.robot import forward_kinematics
from opl.files.resources import folder
from opl.report.drawn import LIFT
from opl.run.batch_page import batch_page
from tests.support.jobs import POST, document, write_job, write_trough

sync_api = pytest.importorskip("playwright.sync_api")
CHROMIUM = os.environ.get("CHROMIUM") or shutil.which("chromium")
if CHROMIUM is None:
    pytest.skip("no chromium is installed", allow_module_level=True)
SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader"]
SOFTWARE.append("--enable-unsafe-swiftshader")


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE)
        yield running
        running.close()


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Deliver a good run, one that a post blocks, and one that the wheel blocks, by name."""
    home = tmp_path_factory.mktemp("runs")
    jobs = {
        "good": write_job(home / "good"),
        "post": write_job(home / "post", {"obstacles": [*document()["obstacles"], POST]}),
        "trough": write_trough(home / "trough"),
    }
    made = {}
    for name, job in jobs.items():
        run = opl.run_job(opl.load_job(job))
        opl.deliver(run, home / name / "out")
        made[name] = run, home / name / "out"
    return made


class Opened:
    """A page, with whatever it said or asked for that it should not have."""

    def __init__(self, browser, path, **context):
        self.context = browser.new_context(viewport={"width": 1280, "height": 900}, **context)
        self.page = self.context.new_page()
        self.wrong = []
        self.page.on("console", lambda message: self.wrong.append(message.text))
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.asked(request.url, path))
        self.page.goto(path.as_uri())
        self.page.locator("body.ready").wait_for()

    def asked(self, url, path):
        if url != path.as_uri() and not url.startswith(("data:", "blob:")):
            self.wrong.append(f"asks for {url}")

    def frame(self):
        """Wait until the next picture is made."""
        self.page.evaluate("() => new Promise(requestAnimationFrame)")
        self.page.evaluate("() => new Promise(requestAnimationFrame)")

    def scrub(self, time):
        self.page.locator("#time").evaluate(
            "(slider, time) => { slider.value = time; slider.dispatchEvent(new Event('input')); }",
            time,
        )
        self.frame()

    def posture(self):
        return self.page.locator("#posture").inner_text()

    def flange(self):
        """Return the pose of the flange as drawn, by the matrices of the scene."""
        return (
            np.array(
                self.page.evaluate(
                    """() => {
                  const { view, page } = window.opl;
                  view.scene.updateMatrixWorld();
                  return [view.joints.at(-1).matrixWorld.elements, page.cell.flange];
                }"""
                )[0]
            )
            .reshape(4, 4)
            .T
        )


@pytest.fixture
def opened(browser):
    pages = []

    def open_page(path, **context):
        pages.append(Opened(browser, path, **context))
        return pages[-1]

    yield open_page
    for one in pages:
        one.context.close()
        assert one.wrong == []


def chart_click(one, point, position):
    """Click the middle of a cell of the contact chart."""
    field = one.page.evaluate("() => [window.opl.chart.count, window.opl.chart.t.length]")
    box = one.page.locator("#chart").bounding_box()
    one.page.locator("#chart").click(
        position={
            "x": box["width"] * (point + 0.5) / field[0],
            "y": box["height"] * (1.0 - (position + 0.5) / field[1]),
        }
    )
    one.frame()


def test_the_animation_advances(runs, opened):
    one = opened(runs["good"][1] / "report.html")
    before = one.posture(), one.flange()
    one.page.locator("#play").click()
    one.page.wait_for_timeout(1200)
    one.page.locator("#play").click()
    assert one.page.evaluate("() => window.opl.view.drawn") > 3
    assert one.posture() != before[0] and not np.allclose(one.flange(), before[1], atol=1e-3)


def test_the_drawn_robot_is_where_the_motion_is_and_its_point_on_the_wheel(runs, opened):
    run, out = runs["good"]
    motion, one = run.proven.motion.motion, opened(out / "report.html")
    times = np.cumsum(run.proven.motion.timed.duration)
    joint = run.surfaced.job.cell.robot
    T_joint_flange = np.array(one.page.evaluate("() => window.opl.page.cell.flange")).reshape(4, 4)
    whole = np.flatnonzero(motion.on_wheel & (motion.cutter_point % 1.0 == 0.0))
    points, cell, met = run.surfaced.points, run.surfaced.job.cell, 0
    for move in [*np.linspace(1, len(motion) - 1, 4).astype(int), *whole[[0, len(whole) // 2]]]:
        one.scrub(float(times[move]))
        drawn = one.flange() @ T_joint_flange
        assert np.allclose(drawn, forward_kinematics(joint, motion.q[move]), atol=2e-5)
        if motion.on_wheel[move] and motion.cutter_point[move] % 1.0 == 0.0:
            on_part, on_wheel = one.page.evaluate(
                """(point) => {
                  const { scene, trace, dot } = window.opl.view;
                  scene.updateMatrixWorld();
                  const place = dot.position.clone();
                  place.fromBufferAttribute(trace.geometry.getAttribute("position"), point);
                  place.applyMatrix4(trace.matrixWorld);
                  return [place.toArray(), dot.position.toArray()];
                }""",
                int(motion.cutter_point[move]),
            )
            point = int(motion.cutter_point[move])
            T_workpiece_cutter = points.Ts_workpiece_cutter[point]
            lifted = cell.T_flange_workpiece @ T_workpiece_cutter @ [0.0, 0.0, LIFT, 1.0]
            place = forward_kinematics(joint, motion.q[move]) @ lifted
            assert np.allclose(on_part, place[:3], atol=2e-5)
            T_base_contact = cell.wheel.T_base_contact(motion.contact_position[move])
            assert np.allclose(on_wheel, T_base_contact[:3, 3], atol=2e-5)
            if motion.written[move]:  # between written positions the part may slide over the belt
                assert np.linalg.norm(np.subtract(on_part, on_wheel)) < LIFT + 1e-4
                met += 1
    assert met > 0


def test_scrubbing_moves_chart_and_curves_together(runs, opened):
    run, out = runs["good"]
    one, motion = opened(out / "report.html"), run.proven.motion.motion
    times = np.cumsum(run.proven.motion.timed.duration)
    ground = np.flatnonzero(motion.on_wheel)
    seen = set()
    for move in ground[[len(ground) // 4, len(ground) // 2]]:
        one.scrub(float(times[move]))
        shown = one.page.evaluate("() => window.opl.shown")
        assert shown["point"] == pytest.approx(motion.cutter_point[move], abs=1e-3)
        assert shown["t"] == pytest.approx(motion.contact_position[move], abs=1e-3)
        cursor = one.page.locator("#chart-cursor")
        assert cursor.is_visible()
        count = one.page.evaluate("() => window.opl.chart.count")
        left = float(cursor.evaluate("mark => parseFloat(mark.style.transform.slice(10))"))
        assert left == pytest.approx(100.0 * (motion.cutter_point[move] + 0.5) / count, abs=0.05)
        cursor = one.page.locator("#curves .cursor")
        x = float(cursor.evaluate("one => parseFloat(one.style.transform.slice(11))"))
        assert x == pytest.approx(100.0 * times[move] / times[-1], abs=0.01)
        seen.add((left, x))
    assert len(seen) == 2


@pytest.mark.parametrize("name", ["post", "trough"])
def test_a_refused_job_begins_at_its_blocked_point_with_the_collision_marked(name, runs, opened):
    one = opened(runs[name][1] / "report.html")
    survey = runs[name][0].reached.survey
    cell = one.page.evaluate("() => window.opl.shown")
    names = {"part", "wheel"} if name == "trough" else set(cell["hit"])
    assert names and set(one.page.evaluate("() => window.opl.view.red")) == names
    assert cell["point"] is not None and cell["q"] is not None
    assert not (survey.states[int(cell["point"])] == 0).any()
    assert "No path" in one.page.locator(".verdict").inner_text()


def test_clicking_a_blocked_cell_poses_the_robot_in_the_named_collision(runs, opened):
    run, out = runs["post"]
    one, prepared = opened(out / "report.html"), run.reached
    survey, scene = prepared.survey, prepared.problem.scene.collision
    rng = np.random.default_rng(0)
    blocked = np.argwhere(survey.hit >= 0)
    for point, position in blocked[rng.permutation(len(blocked))[:5]]:
        chart_click(one, point, position)
        shown = one.page.evaluate("() => window.opl.shown")
        shown["q"] = list(shown["q"].values()) if isinstance(shown["q"], dict) else shown["q"]
        pair = survey.pairs[survey.hit[point, position]]
        assert " and ".join(pair) in one.posture()
        assert set(one.page.evaluate("() => window.opl.view.red")) == set(pair)
        assert np.allclose(shown["q"], survey.q[point, position], atol=5e-4)
        assert tuple(pair) in scene.colliding_pairs(np.array(shown["q"]))


def test_what_the_pointer_is_told_is_what_the_files_say(runs, opened):
    out = runs["good"][1]
    one = opened(out / "report.html")
    result = json.loads((out / "result.json").read_text())
    text = one.page.locator("body").inner_text()
    found = result["verification"]
    for figure in (
        f"{found['min_clearance_mm']:.3f}",
        f"{found['max_contact_error_mm']:.4f}",
        f"{result['path']['joint_range_sum_rad']:.6f}",
        f"{result['cycle']['total_s']:.3f}",
        *(f"{value:.6f}" for value in result["path"]["joint_ranges_rad"]),
        *result["program"]["sha256"].values(),
    ):
        assert figure in text, figure
    trace = json.loads((out / "V_SHAPE_motion.json").read_text())
    one.page.locator("#curves-of").select_option("feed")
    panel = one.page.locator("#curves svg").nth(1)
    box = panel.bounding_box()
    rows = [k for k, kind in enumerate(trace["kind"]) if kind == "grind"]
    for k in rows[1:-1:4]:
        x = box["width"] * trace["time_s"][k] / trace["time_s"][-1]
        panel.dispatch_event(
            "pointermove", {"clientX": box["x"] + x, "clientY": box["y"] + 5.0, "bubbles": True}
        )
        told = one.page.locator("#hover").inner_text()
        assert float(told.split("t ")[-1].split()[0]) == pytest.approx(trace["t"][k], abs=0.02)


def test_curves_findings_and_rows_lead_to_their_configuration(runs, opened):
    run, out = runs["good"]
    one, found = opened(out / "report.html"), opl.make_report(run).verification
    motion, times = run.proven.motion.motion, np.cumsum(run.proven.motion.timed.duration)
    chain = np.array(one.page.evaluate("() => window.opl.page.cell.flange")).reshape(4, 4)
    robot = run.surfaced.job.cell.robot
    for mark, place in (("nearest", found.min_clearance_at), ("off", found.max_contact_error_at)):
        one.page.locator(f'[data-mark="{mark}"]').click()
        one.frame()
        wanted = forward_kinematics(robot, np.deg2rad(place.joints_deg))
        assert np.allclose(one.flange() @ chain, wanted, atol=5e-5)
        assert set(one.page.evaluate("() => window.opl.view.red")) == set(
            place.subject.split(" and ")
        )
        assert one.page.locator("#view").bounding_box()["y"] < 900
    one.page.locator('[data-mark="home"]').click()
    one.frame()
    assert np.allclose(one.flange() @ chain, forward_kinematics(robot, motion.q[0]), atol=2e-5)
    panel = one.page.locator("#curves svg").first
    panel.click(position={"x": panel.bounding_box()["width"] / 2.0, "y": 20.0})
    shown = one.page.evaluate("() => window.opl.shown")
    assert shown["time"] == pytest.approx(times[-1] / 2.0, rel=0.01)


def test_a_line_of_the_program_leads_to_its_configuration_and_back(runs, opened):
    run, out = runs["good"]
    one = opened(out / "report.html")
    lines = (out / "V_SHAPE.JBI").read_text(encoding="ascii").splitlines()
    moves = one.page.locator("#program .move")
    assert moves.count() == len(run.program.moves)
    for k in (1, len(run.program.moves) // 2, len(run.program.moves) - 1):
        row = moves.nth(k)
        assert row.inner_text().strip() in {line.strip() for line in lines if "MOVJ" in line}
        row.click()
        shown = one.page.evaluate("() => Array.from(window.opl.shown.q)")
        assert np.allclose(shown, run.program.moves[k].q, atol=1e-5)
        assert "now" in row.get_attribute("class").split()
    one.page.locator("#program-0").press("ArrowUp")  # as with the pointer
    shown = one.page.evaluate("() => Array.from(window.opl.shown.q)")
    assert np.allclose(shown, run.program.moves[-2].q, atol=1e-5)
    one.page.locator("#program-0").press("Tab")
    assert np.allclose(one.page.evaluate("() => Array.from(window.opl.shown.q)"), shown)


@pytest.mark.parametrize("name", ["good", "post", "trough"])
def test_a_page_prints_on_two_sheets_whose_words_fit(name, runs, opened, tmp_path):
    one = opened(runs[name][1] / "report.html")
    printed = one.page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 2
    one.page.emulate_media(media="print")
    one.page.set_viewport_size({"width": 718, "height": 1000})  # 190 mm of paper
    pieces = "() => [...document.querySelectorAll('table, p, ul')]"
    wide = f"{pieces}.filter((one) => one.getBoundingClientRect().right > 719)"
    assert one.page.evaluate(f"{wide}.map((one) => one.innerText)") == []


def test_a_cell_is_saved_as_gltf(runs, opened, tmp_path):
    one = opened(runs["good"][1] / "report.html", accept_downloads=True)
    with one.page.expect_download() as download:
        one.page.locator("#save").click()
    assert download.value.suggested_filename == "V_SHAPE.glb"
    download.value.save_as(tmp_path / "cell.glb")
    content = (tmp_path / "cell.glb").read_bytes()
    assert content[:4] == b"glTF" and int.from_bytes(content[8:12], "little") == len(content)
    length = int.from_bytes(content[12:16], "little")
    nodes = json.loads(content[20 : 20 + length])["nodes"]
    assert {"part", "wheel", "floor"} <= {node.get("name") for node in nodes}


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_is_wider_than_the_screen(scheme, width, runs, opened):
    one = opened(runs["good"][1] / "report.html", color_scheme=scheme)
    one.page.set_viewport_size({"width": width, "height": 800})
    one.frame()
    assert one.page.evaluate("() => document.documentElement.scrollWidth") <= width


def test_the_keyboard_reaches_chart_view_and_player(runs, opened):
    one = opened(runs["good"][1] / "report.html")
    reached = set()
    for _ in range(40):
        one.page.keyboard.press("Tab")
        reached.add(one.page.evaluate("() => document.activeElement.id"))
    assert {"view", "play", "time", "look", "paint", "chart", "save"} <= reached
    one.page.locator("#chart").focus()
    one.page.keyboard.press("ArrowRight")
    first = one.posture()
    one.page.keyboard.press("ArrowUp")
    assert first.startswith("cutter point 1,") and one.posture() != first


def test_pages_of_points_and_of_a_cell_open(browser, opened, tmp_path):
    surfaced = opl.cut_surface(opl.load_job(write_job(tmp_path / "j")))
    for name, text in opl.points_files(surfaced).items():
        if name.endswith(".html"):
            (tmp_path / name).write_text(text)
    one = opened(tmp_path / "V_SHAPE_points.html")
    one.page.locator("#paint").select_option("ridge")
    one.frame()
    assert one.page.locator("#scale-high").inner_text().endswith("micrometres of ridge")
    belt_cell = folder("workpieces") / "cells" / "belt_cell.yaml"
    (tmp_path / "cell.html").write_text(opl.cell_page(opl.load_cell(belt_cell)))
    assert "home" in opened(tmp_path / "cell.html").posture()


def test_a_batch_is_sorted_by_a_click(browser, runs, tmp_path):
    rows = [
        opl.BatchRow(out.parent / "job.yaml", run.status, 0, out, "", opl.make_report(run))
        for run, out in runs.values()
    ]
    (tmp_path / "report.html").write_text(batch_page(5 * rows, tmp_path))
    context = browser.new_context()
    page = context.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    status = page.locator("tbody tr td:nth-child(2)")
    before = status.all_inner_texts()
    page.locator("thead button").nth(1).click()
    assert status.all_inner_texts() == sorted(before)
    page.locator("thead button").nth(1).click()
    assert status.all_inner_texts() == sorted(before, reverse=True)
    page.emulate_media(media="print")
    assert sum(row.is_visible() for row in page.locator("tbody tr").all()) == 5 * len(rows)
    page.emulate_media(media="screen")
    page.locator("tbody a").first.click()
    page.locator("body.ready").wait_for()
    context.close()
