# The packages in dist/: building, trying, and comparing them with those of another folder; and releases.

# Each processor's archives, default and minimal. scripts/build/archive lets builds wait that share a
# folder, so `make -j` builds the others at the same time. The first ones share no folder.
APART := atmega328p atmega2560 cortex-m0plus cortex-m3 riscv32imc esp8266 esp32 cortex-m4 cortex-m33 riscv32imac
MCU_BUILDS := $(patsubst %,build-archive-%,$(APART) $(filter-out $(APART),$(MCUS)))
.PHONY: $(MCU_BUILDS)
$(MCU_BUILDS): build-archive-%:
	+@scripts/build/archive $*
	+@scripts/build/archive $* minimal

.PHONY: dist
dist: $(ARCHIVE) ## Write all packages to dist/, with their SHA-256 sums; builds what they contain
	@scripts/need gcc libc6-dev libmbedtls-dev gcc-aarch64-linux-gnu libc6-dev-arm64-cross dpkg-dev
	@$(MAKE) --no-print-directory -j$$(nproc) $(MCU_BUILDS)
	@$(MAKE) --no-print-directory assembler $(INSTALLED_TOOL) man archive-aarch64
	@scripts/release/dist

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

# What a release builds and checks. RELEASE_TARGETS= leaves it out, for a rehearsal in seconds.
RELEASE_TARGETS ?= check test dist check-dist
.PHONY: release check-release
release: ## Prepare a release, VERSION=x.y.z: version, changelog, checks, packages, tag; REHEARSE=yes changes nothing
	@scripts/need git python3 make gcc libc6-dev abigail-tools
	@CARGO="$(CARGO)" RELEASE_TARGETS="$(RELEASE_TARGETS)" scripts/release/release $(VERSION) $(if $(REHEARSE),--rehearse)

check-release: ## Try scripts/release/release and scripts/release/version in a copy: what they refuse, and a release
	@scripts/need git python3 make gcc libc6-dev binutils abigail-tools
	@$(HEADER) --check
	@CARGO="$(CARGO)" scripts/release/check
