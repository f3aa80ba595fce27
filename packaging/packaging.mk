# The packages in dist/: building, trying, and comparing them with those of another folder; and releases.

# Each processor's archive. scripts/build/archive lets builds wait that share a folder, so `make -j`
# builds the others at the same time. The first ones share no folder.
APART := atmega328p atmega2560 cortex-m0plus cortex-m3 riscv32imc esp8266 esp32 cortex-m4 cortex-m33 riscv32imac
MCU_BUILDS := $(patsubst %,build-archive-%,$(filter $(MCUS),$(APART)) $(filter-out $(APART),$(MCUS)))
.PHONY: $(MCU_BUILDS)
$(MCU_BUILDS): build-archive-%:
	+@scripts/build/archive $*

# Missing packages are installed or named before the first build.
.PHONY: need-packages
need-packages:
	@scripts/build/archive --packages $(MCUS) atmega4809 -- $(DEBIAN_NEEDS) python3 gcc-aarch64-linux-gnu libc6-dev-arm64-cross

# The parts of an SDK for some boards alone: theirs, and the library for this machine.
.PHONY: sdk-parts
sdk-parts:
	@archives=$$(MBM_BOARDS="$(BOARDS)" scripts/build/boards.py --archives) && \
		scripts/build/archive --packages $$archives -- $(LINUX_NEEDS) libmbedtls-dev && \
		$(MAKE) --no-print-directory -j$$(nproc) linux assembler $$(printf 'build-archive-%s ' $$archives)

.PHONY: dist-parts
dist-parts: need-packages $(ARCHIVE)
	@$(MAKE) --no-print-directory -j$$(nproc) $(MCU_BUILDS)
	@$(MAKE) --no-print-directory assembler tool-parts archive-aarch64

.PHONY: dist
dist: dist-parts ## Write all packages to dist/, with their SHA-256 sums; builds what they contain
	@scripts/release/dist

# The contents of the package of each kind. The crates and the source have what is in the clone.
PARTS_arduino := assembler
PARTS_crates :=
PARTS_debian := tool-parts
PARTS_esp-idf := assembler BOARDS="riscv esp32"
PARTS_platformio := $(ARCHIVE) assembler
PARTS_rt-thread := assembler BOARDS="arm riscv"
PARTS_sbom := $(ARCHIVE)
PARTS_sdk = $(if $(BOARDS),sdk-parts,dist-parts)
PARTS_source :=
PARTS_zephyr := assembler BOARDS="arm riscv"
# What the scripts of each kind need themselves, beside its parts.
NEEDS_crates = rust python3
NEEDS_debian = $(DEBIAN_NEEDS)
NEEDS_platformio = rust gcc libc6-dev python3
NEEDS_sbom = rust gcc libc6-dev python3
KIND ?=
PACKAGE_KINDS := $(patsubst packaging/%/pack,%,$(wildcard packaging/*/pack))
.PHONY: package
package: ## Write the packages of one kind to dist/, KIND=arduino, crates, debian, esp-idf, platformio, rt-thread, sdk or zephyr
	@[ -n "$(filter $(KIND),$(PACKAGE_KINDS))" ] || { echo "package: KIND is one of $(PACKAGE_KINDS)" >&2; exit 1; }
	@$(if $(NEEDS_$(KIND)),scripts/need $(NEEDS_$(KIND)),$(NEED_PYTHON))
	@$(if $(PARTS_$(KIND)),$(MAKE) --no-print-directory $(PARTS_$(KIND)))
	@mkdir -p dist
	@MBM_BOARDS="$(BOARDS)" packaging/$(KIND)/pack dist

# The packages that people ask for by name. BOARDS are boards, families of boards or archives.
.PHONY: sdk deb single
sdk: ## Write the C SDK to dist/; BOARDS="uno cortex-m4" for these boards alone
	@$(MAKE) --no-print-directory package KIND=sdk

deb: ## Write the Debian packages of this machine to dist/: mbm, libmbm0 and libmbm-dev
	@$(MAKE) --no-print-directory package KIND=debian

BOARD ?=
PARTS ?=
single: ## Write mbm.h and mbm.S, the library for BOARD in two files, to dist/single; PARTS="master ring": these headers alone
	@$(NEED_PYTHON)
	@[ "$(BOARD)" ] || { echo "single: say BOARD=uno, or another board or archive of these:" >&2; \
		scripts/build/boards.py --list | sed 1d >&2; exit 1; }
	@scripts/build/single --check $(BOARD) $(PARTS)
	@$(MAKE) --no-print-directory assembler BOARDS="$(BOARD)"
	@scripts/build/single $(BOARD) dist/single/$$(echo $(BOARD) $(PARTS) | tr " " -) $(PARTS)

# The boards on which those two files are tried, in scripts/check/single.
SINGLE_BOARDS := uno cortex-m0plus cortex-m4 esp32c3
.PHONY: single-parts check-single two-files
single-parts:
	@scripts/need python3 simavr qemu-system-arm qemu-system-misc gcc-avr avr-libc gcc-arm-none-eabi libnewlib-arm-none-eabi \
		gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf
	@$(MAKE) --no-print-directory assembler BOARDS="$(SINGLE_BOARDS)"
check-single: single-parts ## Drop those two files into an empty project: a master, a server and both on four boards, in simulators
	@scripts/check/single
two-files: single-parts ## Compare them with the two files of nanoMODBUS, NANOMODBUS=clone of nanoMODBUS; writes docs/reports/two-files.md
	@scripts/check/single --write "$(NANOMODBUS)"
	@scripts/build/pictures

# DOOR is a word of a door's heading. Without it the page is written.
DOOR ?=
.PHONY: doors
doors: tool ## Open the doors of the README on a Debian 12 with nothing installed; transcripts in build/doors; writes docs/reports/doors.md
	@scripts/need python3 mmdebstrap git
	@scripts/bench/doors $(or $(DOOR),--write)

KINDS ?=
.PHONY: check-dist
check-dist: ## Use each package of dist/ in an empty folder as its user would; KINDS="sdk debian" tries these
	@scripts/release/try $(KINDS)

.PHONY: check-reproducible
check-reproducible: ## Write all packages again from a clone in another folder, and compare them with dist/
	@scripts/need git
	@CARGO="$(CARGO)" scripts/release/dist --again

.PHONY: publish
publish: ## Upload dist/ to the registries whose secrets are set, with MBM_PUBLISH=yes; else try all but the upload
	@scripts/need python3 python3-venv git unzip
	@cd dist && sha256sum --quiet --check SHA256SUMS
	@set -e; for publish in packaging/*/publish; do CARGO="$(CARGO)" $$publish dist; done

# The targets that a release builds and checks. RELEASE_TARGETS= leaves it out, for a rehearsal in seconds.
RELEASE_TARGETS ?= check test dist check-dist
.PHONY: release check-release
release: ## Prepare a release, VERSION=x.y.z: version, changelog, checks, packages, tag; REHEARSE=yes changes nothing
	@scripts/need git python3 make gcc libc6-dev abigail-tools
	@CARGO="$(CARGO)" RELEASE_TARGETS="$(RELEASE_TARGETS)" scripts/release/release $(VERSION) $(if $(REHEARSE),--rehearse)

check-release: ## Try scripts/release/release and scripts/release/version in a copy: what they refuse, and a release
	@scripts/need git python3 make gcc libc6-dev binutils abigail-tools
	@$(HEADER) --check
	@CARGO="$(CARGO)" scripts/release/check
