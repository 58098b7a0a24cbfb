"""Run a job on the service of opl: python opl_run.py ADDRESS FOLDER OUT. Standard library only."""

import base64
import json
import pathlib
import sys
import time
from urllib import error, request

address, folder, out = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
files = {}
for path in filter(pathlib.Path.is_file, folder.rglob("*")):
    content = base64.b64encode(path.read_bytes()).decode()
    files[path.relative_to(folder).as_posix()] = {"base64": content}
body = json.dumps({"task": "run", "files": files}).encode()
asked = request.Request(address + "/v1/jobs", body, {"Content-Type": "application/json"})
try:
    job = json.load(request.urlopen(asked, timeout=60))
except error.HTTPError as refused:
    sys.exit(refused.read().decode())
while job["state"] in ("queued", "running"):
    time.sleep(0.3)
    job = json.load(request.urlopen(address + "/v1/jobs/" + job["id"], timeout=60))
if job["status"] != "ok":
    sys.exit(job["message"])
out.mkdir(parents=True, exist_ok=True)
for file in job["files"]:
    (out / file["name"]).write_bytes(request.urlopen(address + file["url"], timeout=60).read())
