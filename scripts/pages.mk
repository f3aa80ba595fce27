# The pages: their programs, their pictures, and the documentation site.

.PHONY: pictures
pictures: ## Draw the pictures and charts of the pages, docs/pictures
	@scripts/need python3
	@scripts/pictures
	@scripts/charts

# The programs that the commands in the pages run.
PAGE_PROGRAMS := $(patsubst %,$(BUILD)/plain/linux/%,basic custom_command gateway guarded_server) $(KEEP_LINK) $(UDP) $(SNIFF) $(CLIENTS) $(SERVE)
.PHONY: check-pages
check-pages: $(ARCHIVE) ## Compile and run the blocks of README and docs, and check links; PAGES=--all: skip nothing
	@scripts/need python3 git gcc clang libc6-dev cmake make pkg-config libmodbus-dev libmbedtls-dev openssl \
		gcc-avr avr-libc arduino-core-avr \
		$(if $(filter --all,$(PAGES)),gcc-arm-none-eabi libnewlib-arm-none-eabi gcc-aarch64-linux-gnu libc6-dev-arm64-cross) \
		$(FIRMWARE_LIBC)
	@$(MAKE) --no-print-directory $(PAGE_PROGRAMS)
	@scripts/check-pages $(PAGES)

# The documentation site.
.PHONY: docs
docs: ## Make the documentation site, build/site, and check its links, entries and search
	@scripts/need python3 python3-venv doxygen tidy git
	@CARGO="$(CARGO)" scripts/docs

.PHONY: docs-serve
docs-serve: docs ## Make the site and serve it at http://127.0.0.1:8000/
	@python3 -m http.server --bind 127.0.0.1 --directory $(BUILD)/site 8000

.PHONY: check-docs-site
check-docs-site: docs ## Open the site in Chromium: width of a phone, requests, search; pictures in build/screenshots
	@scripts/need chromium
	@scripts/venv $(BUILD)/venv-browser docs/site/browser-requirements.txt
	@$(BUILD)/venv-browser/bin/python -B scripts/check-site-in-browser
	@$(BUILD)/venv-browser/bin/python -B scripts/screenshots
