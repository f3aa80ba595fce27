# mbm: `make help` lists what there is.

CARGO ?= cargo
CC := gcc
CXX := g++
BUILD := build
ARCHIVE := target/release/libmbm.a

WARNINGS := -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wundef -Werror
INCLUDES := -Iinclude -Iexamples/linux -Ic-tests/support -Ic-tests/shim
CFLAGS := -std=c11 -O1 -g
CXXFLAGS := -std=c++11 -O1 -g
MODBUS = $(shell pkg-config --cflags libmodbus)
LIBS := -Wl,--gc-sections -lmodbus -lcmocka -lpthread
SANITIZERS := -fsanitize=address,undefined -fno-sanitize-recover=all

SUPPORT := $(wildcard c-tests/support/*.c) examples/linux/mbm_tty.c
TESTS := $(patsubst c-tests/%.c,%,$(wildcard c-tests/test_*.c)) \
         $(patsubst c-tests/%.cpp,%,$(wildcard c-tests/test_*.cpp))
HEADERS := $(wildcard include/*.h c-tests/support/*.h c-tests/shim/* examples/linux/*.h)

.PHONY: help
help: ## What there is
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 18

.PHONY: archive
archive: ## The archive for this machine, target/release/libmbm.a
	@$(CARGO) rustc --quiet --release --lib --crate-type staticlib --features archive
	@echo "archive: $(ARCHIVE)"

# One folder of test programs a variant: $(1) name, $(2) flags
define variant
$(BUILD)/$(1)/%.o: c-tests/%.c $(HEADERS)
	@mkdir -p $$(@D)
	@$(CC) $(CFLAGS) $(2) $(WARNINGS) $(INCLUDES) $$(MODBUS) -c $$< -o $$@
$(BUILD)/$(1)/%.o: c-tests/%.cpp $(HEADERS)
	@mkdir -p $$(@D)
	@$(CXX) $(CXXFLAGS) $(2) $(WARNINGS) $(INCLUDES) $$(MODBUS) -c $$< -o $$@
$(BUILD)/$(1)/%.o: examples/%.c $(HEADERS)
	@mkdir -p $$(@D)
	@$(CC) $(CFLAGS) $(2) $(WARNINGS) $(INCLUDES) $$(MODBUS) -c $$< -o $$@
$(TESTS:%=$(BUILD)/$(1)/%): %: %.o $(patsubst c-tests/%.c,$(BUILD)/$(1)/%.o,$(patsubst examples/%.c,$(BUILD)/$(1)/%.o,$(SUPPORT))) archive
	@$(CXX) $(2) $$(filter %.o,$$^) $(ARCHIVE) $(LIBS) -o $$@
endef
$(eval $(call variant,plain,))
$(eval $(call variant,sanitized,$(SANITIZERS)))
.SECONDARY:

# The same flags as the peer's package is built with.
$(eval $(call variant,bench,-O2))
BENCH := $(BUILD)/bench/bench
$(BENCH): $(patsubst %,$(BUILD)/bench/%.o,bench support/pty support/server linux/mbm_tty) archive
	@$(CC) $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -lmodbus -lpthread -o $@

.PHONY: bench
bench: ## Speed and instructions of mbm beside libmodbus's own client
	@scripts/need gcc libc6-dev pkg-config libmodbus-dev valgrind
	@$(MAKE) --no-print-directory $(BENCH)
	@scripts/bench $(BENCH)

DEMO := $(BUILD)/plain/linux/demo
$(DEMO): $(patsubst %,$(BUILD)/plain/%.o,linux/demo linux/frame_words linux/recorder linux/mbm_tty support/pty support/server) archive
	@$(CC) $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -lmodbus -lpthread -o $@
$(BUILD)/plain/linux/basic: $(patsubst %,$(BUILD)/plain/%.o,linux/basic linux/mbm_tty) archive
	@$(CC) $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -o $@

.PHONY: demo
demo: ## Every function at work against a libmodbus server, frame by frame
	@scripts/need gcc libc6-dev pkg-config libmodbus-dev
	@$(MAKE) --no-print-directory $(DEMO) $(BUILD)/plain/linux/basic
	@$(DEMO)

# The C of the README compiles as it stands.
.PHONY: check-readme
check-readme:
	@mkdir -p $(BUILD)
	@sed -n '/^```c$$/,/^```$$/p' README.md | sed '/^```/d' >$(BUILD)/readme.c
	@test -s $(BUILD)/readme.c
	@$(CC) -std=c11 $(WARNINGS) -Iinclude -c $(BUILD)/readme.c -o $(BUILD)/readme.o
	@echo "check-readme: the README's C compiles"
