# `make run` throws the bar into the cup; `make test` is for every day, `make verify` is the rest.
PYTHON ?= python3
BIN := .venv/bin
PIP := PIP_CONSTRAINT=$(CURDIR)/constraints.txt $(BIN)/pip install --quiet --disable-pip-version-check
# Strict: the type checker sees what a wheel would hold, not the whole folder.
EDITABLE := --config-settings editable_mode=strict --editable
FILES := pyproject.toml constraints.txt $(wildcard *.py core/*.[ch] */*/*.toml \
	$(foreach d,core models problems planner cli cycles lab pictures robots,$d/*.py $d/*/*.py $d/*/*/*.py))

# Two processes; the tests of a file stay together, for the plans that they share.
PYTEST := PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 $(BIN)/pytest --numprocesses 2 --dist loadfile

.PHONY: core run test verify wheels report site extras pictures notebooks notebooks-executed clean

run: .venv/run
	$(BIN)/throwplan plan cup --out out/cup

test: .venv/test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	cd .venv && bin/mypy --config-file ../pyproject.toml
	$(BIN)/lint-imports --no-cache
	$(PYTEST) -m "not slow"

# What takes longer: notebooks executed, MuJoCo over many cases, sections of the report. The same hostile input each
# time; `make verify SEED=2` looks for more.
SEED ?= 1
verify: .venv/test .venv/sim .venv/docs .venv/wheels
	$(PYTEST) -m slow --hypothesis-seed=$(SEED)

# What a release consists of, in dist/: the sources, and of them a wheel for each platform, whatever the Python. GCC
# compiles for Linux on x86-64, where batches of throws run 1.7 times as fast by it, zig for the others.
DIST ?= dist
ZIG := $(abspath $(BIN))/python -m ziglang cc -s -target
CC_manylinux_2_28_x86_64 := gcc
CC_manylinux_2_28_aarch64 := $(ZIG) aarch64-linux-gnu.2.28
CC_macosx_11_0_arm64 := $(ZIG) aarch64-macos.11.0
CC_win_amd64 := $(ZIG) x86_64-windows-gnu
PLATFORMS := manylinux_2_28_x86_64 manylinux_2_28_aarch64 macosx_11_0_arm64 win_amd64
WHEEL = $(BIN)/pip wheel --quiet --disable-pip-version-check --no-cache-dir --no-build-isolation --no-deps \
	--wheel-dir $(DIST) $(DIST)/*.tar.gz --config-settings=--build-option=--plat-name=
wheels: .venv/wheels
	rm -rf $(DIST)
	$(BIN)/python setup.py --quiet sdist --dist-dir $(DIST)
	$(foreach platform,$(PLATFORMS),CC="$(CC_$(platform))" $(WHEEL)$(platform) &&) true
	$(BIN)/twine --no-color check --strict $(DIST)/*
	for wheel in $(DIST)/*manylinux*; do $(BIN)/auditwheel show $$wheel; done

# docs/performance.md: error against run time, stability, reach, robustness, all measured anew in 45 minutes at most,
# with MuJoCo.
report: .venv/test
	$(BIN)/python -m benchmarks

# The site of this version in out/site/VERSION, beside those of others; any warning or dead link is an error. Beside
# them myst-nb leaves the notebooks' pictures.
VERSION = $(shell sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml)
site: .venv/docs
	$(BIN)/sphinx-build --fail-on-warning --fresh-env --quiet -c docs/site -d out/doctrees . out/site/$(VERSION)
	rm -r out/site/jupyter_execute

# The compiled core of a checkout that runs without being installed.
core:
	$(BIN)/python setup.py --quiet build_ext --inplace

# The optional extras beside what is there.
extras: .venv/run
	$(PIP) $(EDITABLE) '.[dask,film,franka,mujoco,objects,ros,urdf,view]'

# README's film and pictures, made again; needs ffmpeg and chromium.
FILTER := fps=10,scale=640:-1:flags=lanczos,split[a][b];[a]palettegen=max_colors=128[p];[b][p]paletteuse=dither=none
pictures: extras
	$(BIN)/throwplan plan cup --out out/cup
	cp out/cup/throw.png docs/cup.png
	cd docs && ../$(BIN)/throwplan scenes --draw drawn.toml --force
	$(BIN)/throwplan view out/cup --mp4 out/cup/throw.mp4
	ffmpeg -loglevel error -y -i out/cup/throw.mp4 -vf "$(FILTER)" docs/cup.gif
	$(BIN)/throwplan play cup --no-browser --hold 90 & sleep 30; \
		$(BIN)/python tests/browser.py http://127.0.0.1:8080 docs/play.png; wait

# The notebooks of examples/ in JupyterLab; and all of them run anew, with their output.
notebooks: .venv/notebooks
	$(BIN)/jupyter lab examples

notebooks-executed: .venv/notebooks
	$(BIN)/python docs/site/execute.py

.venv/run: $(FILES)
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(PIP) $(EDITABLE) .
	touch $@

.venv/test: .venv/run
	$(PIP) --no-compile $(EDITABLE) '.[test]'
	touch $@

# A simulated Franka and robots' URDFs, where there are wheels; without them their tests are skipped. franka-sim asks
# for an older NumPy, which the rules of the controller, all that is used of it, do not need.
.venv/sim: .venv/test
	-$(PIP) $(EDITABLE) '.[sim]' && $(PIP) --no-deps franka-sim
	touch $@

.venv/docs: .venv/run
	$(PIP) --no-compile $(EDITABLE) '.[docs]'
	touch $@

# An environment of its own with the oldest versions that pyproject.toml allows, but for the tests' own packages.
.venv/oldest:
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet uv
	$(BIN)/uv pip compile --quiet --resolution lowest-direct --only-binary :all: --no-annotate \
		--output-file .venv/oldest.txt pyproject.toml
	$(BIN)/pip install --quiet --constraint .venv/oldest.txt $(EDITABLE) '.[test]'
	touch $@

# Zig's compiler is a wheel on most platforms; without it the test of releases is skipped.
.venv/wheels: .venv/run
	-$(PIP) $(EDITABLE) '.[wheels]'
	touch $@

.venv/notebooks: .venv/run
	$(PIP) $(EDITABLE) '.[notebooks]'
	touch $@

clean:
	rm -rf .venv build dist out *.egg-info
