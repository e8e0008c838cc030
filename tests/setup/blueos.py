"""What BlueOS does with a service, after its helper (core/services/helper/main.py): the models and the requests."""

from __future__ import annotations

import http.client
import json
from typing import Any

from pydantic import BaseModel, ConfigDict


class ServiceMetadata(BaseModel):
    """The answer to `/register_service` that BlueOS accepts, with the keys of its newer versions."""

    model_config = ConfigDict(strict=True, extra="forbid")
    name: str
    description: str
    icon: str
    company: str
    version: str
    webpage: str
    api: str
    route: str | None = None
    new_page: bool | None = None
    extra_query: str | None = None
    avoid_iframes: bool | None = None
    works_in_relative_paths: bool | None = None
    sanitized_name: str | None = None


def detect_service(port: int) -> ServiceMetadata | None:
    """The metadata of what listens on a port: `/` must answer 200, then `/register_service` with JSON."""
    if get(port, "/")[0] != http.client.OK:
        return None
    code, text = get(port, "/register_service")
    return ServiceMetadata.model_validate(json.loads(text)) if code == http.client.OK else None


def get(port: int, path: str, **headers: str) -> tuple[int, bytes]:
    """Code and body of a GET."""
    return ask(port, "GET", path, None, headers)


def post(port: int, path: str, content: Any = None, **headers: str) -> tuple[int, Any]:  # noqa: ANN401
    """Code and JSON of a POST as the page sends it."""
    body = json.dumps({} if content is None else content)
    code, text = ask(port, "POST", path, body, {"Content-Type": "application/json"} | headers)
    return code, json.loads(text) if text.startswith(b"{") else text.decode()


def ask(port: int, method: str, path: str, body: str | None, headers: dict[str, str]) -> tuple[int, bytes]:
    """Code and body of a request; a path goes as it is, without being made shorter."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=20.0)
    try:
        connection.request(method, path, body, headers)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()
