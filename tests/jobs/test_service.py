"""The service, from outside: what the command line says, it says too, and nothing else is read."""

import base64
import json
import shutil
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

from opl.client import Client, ServiceError
from opl.errors import InputError
from opl.service.serving import ServiceSettings, serve
from tests.support.jobs import document, opl, write_job
from tests.support.serving import serving

pytest.importorskip("fastapi", reason="needs the extra opl[service]")
EPOCH = {"SOURCE_DATE_EPOCH": "1700000000"}


@pytest.fixture(scope="module")
def service(tmp_path_factory):
    home = tmp_path_factory.mktemp("service")
    with serving(
        home / "store", "--workers", "1", "--max-upload", "2", "--log", str(home / "log"), env=EPOCH
    ) as client:
        client.home = home
        yield client


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return the files of a quick job by name."""
    home = write_job(tmp_path_factory.mktemp("job"), {"name": "SERVED"}).parent
    return {path.name: path.read_bytes() for path in home.iterdir()}


@pytest.fixture(scope="module")
def done(service, files):
    """Run the job; return what was seen of it, the last with its figures."""
    job = service.submit("run", files)
    return [job, *service.follow(job.id)]


def request(service, path, body=None, method=None, **headers):
    """Return status and content of an answer."""
    asked = urllib.request.Request(service._address + path, body, headers, method=method)
    try:
        with urllib.request.urlopen(asked, timeout=60) as answer:
            return answer.status, answer.read(), answer.headers
    except urllib.error.HTTPError as error:
        return error.code, error.read(), error.headers


def with_key(files, path, value):
    text = json.dumps(document({"name": "SERVED", path: value}))
    return {**files, "job.yaml": text.encode()}


# good jobs


def test_the_files_are_those_of_the_command_line(service, files, done, tmp_path, monkeypatch):
    monkeypatch.setenv(*EPOCH.popitem())
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    monkeypatch.chdir(tmp_path)
    assert opl("run", "job.yaml", "-q").status == 0
    made = {path.name: path.read_bytes() for path in (tmp_path / "out" / "SERVED").iterdir()}
    sent = {file.name: service.fetch(done[-1], file.name) for file in done[-1].files}
    assert sent.keys() == made.keys()
    here, there = (json.loads(one.pop("result.json")) for one in (made, sent))
    for one in (here, there):
        del one["seconds"]
        one["program"].pop("digests", None)
    pages = made.pop("report.html"), sent.pop("report.html")
    assert len(pages[0]) == pytest.approx(len(pages[1]), abs=200)  # times of the stages are in it
    assert sent == made
    assert {**there, "program": 0, "verification": 0} == {**here, "program": 0, "verification": 0}


def test_a_job_is_followed_from_the_queue_to_its_figures(done):
    states = [job.state for job in done]
    assert states[-1] == "done" and set(states) <= {"queued", "running", "done"}
    stages = [job.stage for job in done]
    assert {"search", "verification", "export"} <= set(stages)
    assert done[-1].status == "ok" and done[-1].exit_status == 0
    assert done[-1].result["path"]["joint_range_sum_rad"] > 0.0
    assert all(0.0 <= job.fraction <= 1.0 for job in done)
    path = done[-1].result["path"]
    for job in done:  # what is known by now is told of the search only
        assert job.stage == "search" or (job.value, job.lower_bound) == (None, None)
        assert job.lower_bound is None or job.lower_bound <= path["joint_range_sum_rad"]
        assert job.value is None or job.value >= path["lower_bound_rad"]


def test_the_same_job_is_answered_from_the_store(service, files, done):
    again = service.submit("run", files)
    assert (again.id, again.state) == (done[0].id, "done")
    log = (service.home / "log").read_text().splitlines()
    begun = [json.loads(line) for line in log if '"begun"' in line]
    assert [line["job"] for line in begun].count(again.id) == 1


def test_pages_are_strangers_to_the_service(service, done):
    status, page, headers = request(service, done[-1].report)
    assert (status, page[:15]) == (200, b"<!doctype html>")
    assert headers["Content-Security-Policy"].startswith("sandbox allow-scripts")


def test_check_points_verify_and_faces(service, files, done):
    checked = service.submit("check", files, wait_s=60)
    assert checked.result["robot"] == "mh24" and checked.result["cutter_points"] > 5
    points = service.submit("points", files, wait_s=60)
    assert [file.name for file in points.files] == [
        "SERVED_points.csv", "SERVED_points.svg", "SERVED_points.html", "SERVED_cell.json",
        "figures.json",
    ]  # fmt: skip
    program = service.fetch(done[-1], "SERVED.JBI")
    with_program = {**files, "SERVED.JBI": program}
    verified = service.submit("verify", with_program, programs=["SERVED.JBI"], wait_s=60)
    assert verified.status == "ok" and verified.result["proven"]
    faces = service.submit("faces", files, job="v_shape.stl", unit="mm", wait_s=60)
    assert len(faces.result["faces"]) > 3


def test_a_program_that_was_changed_is_not_proven(service, files, done):
    program = service.fetch(done[-1], "SERVED.JBI").replace(b"MOVJ C00003", b"MOVJ C00001")
    sent = {**files, "SERVED.JBI": program}
    found = service.submit("verify", sent, programs=["SERVED.JBI"], wait_s=60)
    assert (found.state, found.status, found.exit_status) == ("failed", "not proven", 4)
    assert found.message.startswith("not proven\n") and found.result["findings"]


def test_json_says_the_same_as_a_form(service, files, done):
    sent = {name: {"base64": base64.b64encode(content).decode()} for name, content in files.items()}
    body = json.dumps({"files": sent}).encode()
    status, answer, _ = request(service, "/v1/jobs", body, **{"Content-Type": "application/json"})
    assert (status, json.loads(answer)["id"]) == (200, done[0].id)


def test_a_job_is_cancelled_and_can_be_begun_again(service, files):
    sent = with_key(files, "passes.rows", 5)
    job = service.submit("run", sent)
    service.cancel(job.id)
    *_, last = service.follow(job.id)
    assert last.state == "cancelled" and last.files == ()
    again = service.submit("run", sent)
    assert again.id == job.id and again.state in ("queued", "running")
    service.cancel(again.id)
    *_, last = service.follow(again.id)
    service.forget(job.id)
    with pytest.raises(ServiceError, match="no job"):
        service.job(job.id)


# what is refused


def test_a_bad_job_says_file_key_and_reason(service, files):
    found = service.submit("run", with_key(files, "wheel.width_mm", -3), wait_s=60)
    assert (found.state, found.status, found.exit_status) == ("failed", "bad input", 2)
    assert found.message == "job.yaml: wheel.width_mm: must be more than 0, got -3"
    assert found.files == ()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("workpiece.mesh", "/etc/passwd"),
        ("workpiece.mesh", "../../opl-jobs.sqlite"),
        ("workpiece.surface", "../in/surface.json/../../../x.json"),
        ("robot", "../../../robots/mh24"),
        ("robot", "/"),
        ("cell", "../../../../../etc/passwd"),
        ("program.template", "/proc/self/environ"),
        ("program.pulse_ratios", "../../../x"),
    ],
)
def test_names_that_lead_out_are_refused_by_their_key(service, files, key, value):
    found = service.submit("check", with_key(files, key, value), wait_s=60)
    assert (found.status, found.files) == ("bad input", ())
    assert found.message.startswith(f"job.yaml: {key}: ")
    assert "lies outside of the job's own files" in found.message


def test_a_robot_of_ones_own_that_names_files_outside_is_refused(service, files):
    from opl.files.resources import folder

    robot = folder("robots") / "mh24"
    own = (robot / "mh24.urdf").read_text()
    shape = '<collision><geometry><mesh filename="{}"/></geometry></collision>'
    for name in ("/etc/passwd", "file:///etc/passwd", "package://a/../../../../../etc/passwd"):
        urdf = own.replace("</link>", shape.format(name) + "</link>", 1)
        sent = {
            **with_key(files, "robot", "arm"),
            "arm/robot.yaml": (robot / "robot.yaml").read_bytes(),
            "arm/mh24.urdf": urdf.encode(),
        }
        found = service.submit("check", sent, wait_s=60)
        assert found.status == "bad input" and "lies outside" in found.message, name


@pytest.mark.parametrize("name", ["../x", "/etc/x", "a/../../x", ".git/config"])
def test_names_of_files_that_lead_out_are_refused(service, files, name):
    before = sorted(service.home.rglob("*"))
    with pytest.raises(ServiceError, match="must") as refused:
        service.submit("run", {**files, name: b"x"})
    assert refused.value.status == 400 and refused.value.where.startswith("file ")
    assert sorted(service.home.rglob("*")) == before


def test_hostile_templates_stay_in_their_sandbox(service, files):
    text = "{{ ''.__class__.__mro__[1].__subclasses__() }}{% include '/etc/passwd' %}"
    sent = {**with_key(files, "program.template", "own.j2"), "own.j2": text.encode()}
    found = service.submit("run", sent, wait_s=60)
    assert found.status == "bad input" and "own.j2" in found.message
    assert "root:" not in found.message


@pytest.mark.parametrize(
    ("body", "where"),
    [
        (b"{", "body"),
        (b"[" * 100_000, "body"),
        (b'{"files": {}}', "files"),
        (b'{"files": {"a": {"text": "x"}}}', "job"),
        (b'{"files": {"job.yaml": {"text": "x", "base64": "eA=="}}}', "files.job.yaml"),
        (b'{"files": {"job.yaml": {"base64": "!"}}}', "files.job.yaml"),
        (b'{"task": "shell", "files": {"job.yaml": {"text": "x"}}}', "body"),
        (b'{"programs": ["x"], "files": {"job.yaml": {"text": "x"}}}', "programs"),
        (b'{"files": {"job.yaml": {"text": ""}, "job.yaml/x": {"text": ""}}}', "file 'job.yaml/x'"),
    ],
)
def test_requests_that_say_nothing_sensible_are_refused(service, body, where):
    status, answer, _ = request(service, "/v1/jobs", body, **{"Content-Type": "application/json"})
    assert (status, json.loads(answer)["where"]) == (400, where)


def test_only_files_that_a_job_made_are_served(service, done):
    for name in ("nothing", "..%2f..%2fin%2fjob.yaml", "%2e%2e/%2e%2e/opl-jobs.sqlite", "job.yaml"):
        status, answer, _ = request(service, f"/v1/jobs/{done[0].id}/files/{name}")
        assert status == 404 and b"name: SERVED" not in answer


def test_pages_of_strangers_are_not_answered(service):
    assert request(service, "/v1/jobs", Origin="http://evil.example")[0] == 403
    assert request(service, "/v1/jobs", Host="evil.example")[0] == 403
    assert request(service, "/v1/jobs", Origin="http://localhost:3000")[0] == 200


def test_too_much_is_refused(service, files):
    with pytest.raises(ServiceError) as refused:
        service.submit("run", {**files, "big": bytes(3_000_000)})
    assert refused.value.status in (413, 0)  # or the answer came before all was sent


# who may ask


def test_beyond_this_machine_a_token_is_needed(tmp_path, files):
    with pytest.raises(InputError, match=r"--host: 0.0.0.0 is for others as well"):
        serve(ServiceSettings(tmp_path / "a", host="0.0.0.0", port=0))
    with pytest.raises(InputError, match="at least 16 characters"):
        serve(ServiceSettings(tmp_path / "a", token="short"))


def test_health_metrics_and_description(service):
    assert service.health()["status"] == "ok"
    status, metrics, _ = request(service, "/metrics")
    assert status == 200 and b'opl_jobs{state="running"}' in metrics
    paths = json.loads(request(service, "/openapi.json")[1])["paths"]
    sent = paths["/v1/jobs"]["post"]["requestBody"]["content"]
    assert set(sent) == {"application/json", "multipart/form-data"}
    assert sent["application/json"]["schema"]["examples"]


def test_the_client_needs_nothing_of_opl(tmp_path):
    from opl import client

    shutil.copy(client.__file__, tmp_path / "client.py")
    script = f"import sys; sys.path[:0] = [{str(tmp_path)!r}]; import client; print(client.Client)"
    ended = subprocess.run([sys.executable, "-I", "-S", "-c", script], capture_output=True)
    assert ended.stdout == b"<class 'client.Client'>\n"


def test_nobody_there_is_said():
    with pytest.raises(ServiceError, match="does not answer"):
        Client("http://127.0.0.1:9").health()
