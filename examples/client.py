#!/usr/bin/env python3
"""A client of grainrig that is made from the daemon's own description; Python's standard library only.

    grainrig serve &
    python3 examples/client.py leighton-buzzard-07 --out results --to-force-n 2

captures a grain, waits, downloads its products, compresses it between two plates and downloads what came of that.
Every operation of /api/v1/openapi.json is a method of `Client` under its operationId: path and query parameters
are keyword arguments, the request's body is `body` (JSON, or bytes for a file); what comes back is JSON as Python has it, or bytes for a file.
"""

import argparse
import json
import pathlib
import sys
import time
import urllib.error
import urllib.parse
import urllib.request

METHODS = ("get", "post", "put", "patch", "delete")


class Refused(Exception):
    """The daemon's answer to a request that it did not fulfil."""

    def __init__(self, status, kind, message):
        super().__init__(f"{message} ({status}, {kind})")
        self.status, self.kind, self.message = status, kind, message


class Client:
    """The daemon's operations, read from its description."""

    def __init__(self, url, token=None):
        self.url, self.token = url.rstrip("/"), token
        self.description = json.loads(self._send("GET", "/api/v1/openapi.json"))
        for path, item in self.description["paths"].items():
            for method in METHODS:
                if method in item:
                    setattr(self, item[method]["operationId"], self._operation(method, path, item[method]))

    def _operation(self, method, path, operation):
        parameters = {p["name"]: p for p in operation.get("parameters", [])}
        is_json = any("application/json" in r.get("content", {})
                      for code, r in operation["responses"].items() if code.startswith("2"))

        def call(body=None, **given):
            unknown = set(given) - set(parameters)
            missing = {n for n, p in parameters.items() if p.get("required")} - set(given)
            if unknown or missing:
                raise TypeError(f"{operation['operationId']}: unknown {sorted(unknown)}, missing {sorted(missing)}")
            place, query = path, {}
            for name, value in given.items():
                if parameters[name]["in"] == "path":
                    place = place.replace("{" + name + "}", urllib.parse.quote(str(value), safe=""))
                elif parameters[name]["in"] == "query":
                    query[name] = value
            if query:
                place += "?" + urllib.parse.urlencode(query)
            answer = self._send(method.upper(), place, body)
            return json.loads(answer) if is_json and answer else answer

        call.__name__ = operation["operationId"]
        call.__doc__ = operation.get("summary")
        return call

    def _send(self, method, place, body=None):
        request = urllib.request.Request(self.url + place, method=method)
        if isinstance(body, bytes):  # a file
            request.data = body
            request.add_header("Content-Type", "application/octet-stream")
        elif body is not None:
            request.data = json.dumps(body).encode()
            request.add_header("Content-Type", "application/json")
        if self.token:
            request.add_header("Authorization", f"Bearer {self.token}")
        try:
            with urllib.request.urlopen(request, timeout=60) as response:
                return response.read()
        except urllib.error.HTTPError as refused:
            error = json.loads(refused.read())["error"]
            raise Refused(refused.code, error["kind"], error["message"]) from None


def wait(look, ended):
    """Asks again and again until one of these states is reached; what was seen then."""
    while True:
        seen = look()
        if seen["state"] in ended:
            return seen
        time.sleep(0.2)


def main():
    parser = argparse.ArgumentParser(description="Captures a grain, compresses it, and downloads the results.")
    parser.add_argument("session", help="name of the new session")
    parser.add_argument("--url", default="http://127.0.0.1:7272", help="where the daemon is")
    parser.add_argument("--token", help="the daemon's token, where it has one")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("."), help="folder for the results")
    parser.add_argument("--to-force-n", type=float, default=2.0,
                        help="compress to this force, N; from 2 N on it goes on to 8 N, so that the transition is known")
    parser.add_argument("--size-at-contact-mm", type=float, help="the same where the plates touch, mm")
    parser.add_argument("--size-mm", type=float, help="largest circumradius of a surface facet, mm")
    asked = parser.parse_args()

    rig = Client(asked.url, asked.token)
    name = rig.start_run(body={"session": asked.session})["session"]
    run = wait(rig.status, ("complete", "aborted", "failed"))
    if run["state"] != "complete":
        sys.exit(f"the run is {run['state']}: {run['error']}")
    session = rig.session(id=name)
    folder = asked.out / name
    folder.mkdir(parents=True, exist_ok=True)
    for product in session["products"]:
        (folder / product["file"]).write_bytes(rig.product(id=name, file=product["file"]))
    print(f"{name}: {session['result']['hull']['volume_estimate_mm3']} mm3, {len(session['products'])} products")
    for warning in session["result"]["warnings"]:
        print(f"note: {warning}")

    figures = {"to_force_n": asked.to_force_n}
    if asked.size_mm:
        figures["size_mm"] = asked.size_mm
    if asked.size_at_contact_mm:
        figures["size_at_contact_mm"] = asked.size_at_contact_mm
    begun = rig.start_compression(id=name, body=figures)["name"]
    # `interrupted` is a compression that failed or was cancelled: nothing computes it any more.
    pressed = wait(lambda: rig.compression(id=name, name=begun), ("complete", "interrupted"))
    if pressed["state"] != "complete":
        sys.exit(f"the compression is {pressed['state']}: {rig.status()['compression']['error']}")
    (folder / begun).mkdir(exist_ok=True)
    for file in pressed["files"]:
        answer = rig.compression_file(id=name, name=begun, file=file["file"])
        (folder / begun / file["file"]).write_bytes(answer)
    print(f"{begun}: {pressed['result']['curve'][-1]['force_n']} N, {len(pressed['files'])} files")


if __name__ == "__main__":
    try:
        main()
    except Refused as refused:
        sys.exit(f"error: {refused}")
