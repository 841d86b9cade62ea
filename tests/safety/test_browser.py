"""A person with a browser and the address that was printed."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from browser import CHROMIUM, FLAGS, NO_PICTURES, VIEW, wait
from playwright.sync_api import sync_playwright
from program import Program


@pytest.mark.slow
@pytest.mark.row(20)
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium: apt-get install chromium")
def test_a_browser_enters_by_the_address_with_the_token_and_the_page_works(tmp_path: Path, measured) -> None:
    secret = tmp_path / "token"
    program = Program(tmp_path / "recordings", "--token", os.fspath(secret))
    token = secret.read_text().strip()
    try:
        with sync_playwright() as playwright, playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS) as chromium:
            stranger = chromium.new_context(viewport=VIEW).new_page().goto(program.url)
            assert stranger is not None
            assert stranger.status == 401
            context = chromium.new_context(viewport=VIEW)
            page = context.new_page()
            page.add_init_script(NO_PICTURES)
            page.goto(f"{program.url}/?token={token}")
            wait(page, "document.querySelector('#teleop')?.dataset.state === 'STOPPED'")
            assert token not in page.url
            assert page.evaluate("document.cookie") == ""
            (cookie,) = context.cookies()
            assert (cookie["httpOnly"], cookie["sameSite"], cookie["value"]) == (True, "Strict", token)
            assert "Traceback" not in program.said
    finally:
        program.close()
    measured(20, "chromium: 401 without; with the token in the address the page drives, its scripts cannot read the cookie")
