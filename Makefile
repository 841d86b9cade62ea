# make run   start the server on http://127.0.0.1:8080
# make test  install what the tests need and run them
# make test-safety  the failsafe contract, row by row, with what was measured (about 11 minutes)
# make check style, types, import contracts
# make bench the figures of the legs and of the speed; teleop-bench --help names the others

PYTHON ?= $(firstword $(foreach p,python3.11 python3.12 python3.13 python3,$(if $(shell $(p) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo yes),$(p))))
BIN := .venv/bin
ARGS ?=

.PHONY: run test test-safety check bench clean

run: .venv/run
	@$(BIN)/teleop serve $(ARGS)

test: .venv/test
	$(BIN)/pytest $(ARGS)

test-safety: .venv/test
	$(BIN)/pytest --contract -m row $(ARGS)

check: .venv/test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright
	$(BIN)/lint-imports

bench: .venv/run
	$(BIN)/teleop-bench walk
	$(BIN)/teleop-bench speed

# torch first and by its exact version: anything looser pulls gigabytes. Fourier's data package asks for more than its
# meshes need, hence --no-deps.
.venv/run: pyproject.toml
	@test -n "$(PYTHON)" || { echo "Python 3.11 or newer is needed: apt-get install python3.11 python3.11-venv"; exit 1; }
	@echo "installing (a few minutes the first time)"
	@test -x $(BIN)/python || $(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check torch==2.13.0
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps fourier-robot-descriptions==0.2.7
	@touch $@

.venv/test: .venv/run
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -e '.[dev,export]'
	@command -v chromium >/dev/null || { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq && apt-get install -y -qq chromium >/dev/null; } \
		|| echo "no chromium: the browser tests will be skipped (apt-get install chromium)"
	@ldconfig -p 2>/dev/null | grep -q libOSMesa || { [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq && apt-get install -y -qq libosmesa6 >/dev/null; } \
		|| echo "no libOSMesa: pictures of exports may not be drawn, their tests will be skipped (apt-get install libosmesa6)"
	@touch $@

clean:
	rm -rf .venv
