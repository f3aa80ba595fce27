# The packages in dist/: building, trying, and comparing them with those of another folder.

# Each processor's archives, default and minimal. scripts/archive lets builds wait that share a
# folder, so `make -j` builds the others at the same time. The first ones share no folder.
APART := atmega328p atmega2560 cortex-m0plus cortex-m3 riscv32imc esp8266 esp32 cortex-m4 cortex-m33 riscv32imac
MCU_BUILDS := $(patsubst %,build-archive-%,$(APART) $(filter-out $(APART),$(MCUS)))
.PHONY: $(MCU_BUILDS)
$(MCU_BUILDS): build-archive-%:
	+@scripts/archive $*
	+@scripts/archive $* minimal

.PHONY: dist
dist: $(ARCHIVE) ## Write all packages to dist/, with their SHA-256 sums; builds what they contain
	@$(MAKE) --no-print-directory -j$$(nproc) $(MCU_BUILDS)
	@$(MAKE) --no-print-directory assembler archive-aarch64
	@scripts/dist

KINDS ?=
.PHONY: check-dist
check-dist: ## Use each package of dist/ in an empty folder as its user would; KINDS="sdk debian" tries these
	@scripts/check-dist $(KINDS)

.PHONY: check-reproducible
check-reproducible: ## Write all packages again from a clone in another folder, and compare them with dist/
	@scripts/need git
	@CARGO="$(CARGO)" scripts/check-reproducible
