# mbm: `make help` lists the targets.

CARGO ?= cargo
comma := ,
BUILD := build
ARCHIVE := target/release/libmbm.a
# The same archive, for tests with the address sanitizer: instrumented, with debug assertions and
# overflow checks, and with ports that are read byte by byte, as in firmware. Optimised less, so that a report names the functions of the source.
SANITIZED_ARCHIVE := $(BUILD)/sanitized/libmbm.a
RUST_SANITIZERS := --cfg mbm_reads_single_bytes -Zsanitizer=address -Cdebug-assertions -Coverflow-checks -Copt-level=1 -Cdebuginfo=line-tables-only

WARNINGS := -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Wundef -Werror
# The hooks of a test seldom use all that they get.
TEST_WARNINGS := $(WARNINGS) -Wno-unused-parameter
INCLUDES := -Iinclude -Iports/linux -Iports/test -Iports/freertos -Iexamples/linux -Ic-tests/support -Ic-tests/shim -Icli
CFLAGS := -std=c11 -O1 -g
CXXFLAGS := -std=c++11 -O1 -g
MODBUS = $(shell pkg-config --cflags libmodbus)
LIBS := -Wl,--gc-sections -lmodbus -lcmocka -lpthread
SANITIZERS := -fsanitize=address,undefined -fno-sanitize-recover=all

# Only programs with TLS link the TLS library.
TLS := $(wildcard ports/linux/mbm_tls*.c) $(wildcard c-tests/support/tls_*.c)
TLS_LIBS := -lmbedtls -lmbedx509 -lmbedcrypto
SUPPORT := $(filter-out $(TLS),$(wildcard c-tests/support/*.c) $(wildcard ports/linux/mbm_*.c))
TESTS := $(patsubst c-tests/%.c,%,$(wildcard c-tests/test_*.c)) \
         $(patsubst c-tests/%.cpp,%,$(wildcard c-tests/test_*.cpp))
TLS_TESTS := $(filter test_tls%,$(TESTS))
# The test kit for ports, and its own tests.
PORT_KIT := $(patsubst ports/%.c,%,$(wildcard ports/test/mbm_porttest*.c))
FREERTOS_TESTS := $(filter test_freertos% test_porttest_freertos,$(TESTS))
LWIP_TESTS := $(filter test_lwip% test_porttest_lwip%,$(TESTS))
LWIP_SOCKETS := over_lwip/mbm_tcp over_lwip/mbm_tcp_listener lwip/mbm_lwip_sockets lwip/serve_sockets lwip/client_sockets
# Those with lwIP's own thread, and a relay to the machine. The others have a wire in memory.
LWIP_RELAY_TESTS := $(filter test_lwip_task test_lwip_sockets test_porttest_lwip%,$(LWIP_TESTS))
LWIP_SOCKET_TESTS := $(filter %_lwip_sockets,$(LWIP_TESTS))
LWIP_WIRE_TESTS := $(filter-out $(LWIP_RELAY_TESTS),$(LWIP_TESTS))
STM32_TESTS := $(filter test_stm32% test_porttest_stm32,$(TESTS))
PICO_TESTS := $(filter test_pico test_porttest_pico,$(TESTS))
# The UARTs of the bare metal port that have registers.
BARE_UARTS := $(filter-out simcall,$(patsubst ports/baremetal/uart/%.c,%,$(wildcard ports/baremetal/uart/*.c)))
# The board that plays Zephyr for the module's own tests, and its wire.
ZEPHYR_TESTS := $(filter test_zephyr%,$(TESTS))
ZEPHYR_STAND_IN := packaging/zephyr/stand-in
WIZNET_TESTS := $(filter test_wiznet test_porttest_wiznet,$(TESTS))
RT_THREAD_TESTS := $(filter test_rt_thread%,$(TESTS))
ESP_IDF_TESTS := $(filter test_esp_idf%,$(TESTS))
PORT_TESTS := $(filter test_porttest%,$(TESTS))
# Examples that the test of the same name runs.
# The short programs of examples/linux. Each is one file over the ports.
EXAMPLES := basic calls custom_client custom_server guarded_server keep_link many_devices udp
PORTS := $(patsubst ports/%.c,%,$(filter-out $(TLS),$(wildcard ports/linux/mbm_*.c)))
# The command line tool.
TOOL := $(wildcard cli/*.c)
# What reads a device file, for its tests.
DEVICE_FILES := $(filter-out cli/device_plan.c,$(wildcard cli/device*.c)) cli/reach.c
# The tool uses what glibc and musl have beside POSIX, such as argp.
TOOL_FLAGS := -D_GNU_SOURCE
TOOL_PORTS := $(wildcard ports/linux/mbm_*.c)
TOOL_LIBS := -Wl,--gc-sections -lmbedtls -lmbedx509 -lmbedcrypto -lcjson -lyaml -lmosquitto -lm -lpthread
# The files that clang-format formats. The headers in include/ are documentation too, and are
# formatted by hand.
C_SOURCES = $(shell git ls-files 'c-tests/*.[ch]' 'c-tests/*.cpp' 'cli/*.[ch]' 'examples/*.[ch]' 'ports/*.[ch]' 'firmware-tests/*.[ch]' \
    'packaging/*.[ch]')

.PHONY: help
help: ## List the targets
	@grep -hE '^[a-z0-9-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 20

.PHONY: archive
archive: $(ARCHIVE) ## Build the archive for this machine, target/release/libmbm.a
	@echo "archive: $(ARCHIVE), by $$(cat $(dir $(ARCHIVE))compiler)"

# What the packages for users need. Each target looks for all of it before it builds anything.
# The library goes without TLS where nothing may be installed.
LINUX_NEEDS = rust gcc libc6-dev binutils pkg-config $(if $(filter no,$(MBM_INSTALL)),,libmbedtls-dev)
TOOL_NEEDS = $(filter-out libmbedtls-dev,$(LINUX_NEEDS)) libmbedtls-dev help2man libcjson-dev libyaml-dev libmosquitto-dev
DEBIAN_NEEDS = $(TOOL_NEEDS) dpkg-dev
# Without Python nothing knows the boards, and so the assemblers that they need; the rest is known.
NEED_PYTHON = command -v python3 >/dev/null || scripts/build/archive --packages -- python3

# Phony, because Cargo decides what is out of date.
.PHONY: $(ARCHIVE) $(SANITIZED_ARCHIVE)
# Cargo must not look for the descriptors of make's job server, which only a `+` would hand on, also to a dry run.
$(ARCHIVE):
	@MAKEFLAGS= CARGO="$(CARGO)" scripts/build/archive --host $@
$(SANITIZED_ARCHIVE):
	@MAKEFLAGS= CARGO="$(CARGO)" scripts/build/archive --host $@ $(RUST_SANITIZERS)

# The library for Linux: the archive with the ports of ports/linux, and libmbm-tls.a.
LIBRARY := $(BUILD)/linux/libmbm.a
.PHONY: linux
linux: ## Build the library for Linux on this machine with its ports, build/linux
	@scripts/need $(LINUX_NEEDS)
	@$(MAKE) --no-print-directory $(ARCHIVE)
	@scripts/build/ports $(ARCHIVE) $(dir $(LIBRARY))
	@echo "linux: $(LIBRARY), and for TLS libmbm-tls.a"

MCUS := $(shell scripts/build/archive --list)
.PHONY: archives
archives: ## Build the archives for microcontrollers, build/archives
	@scripts/build/archive --packages $(MCUS)
	@$(MAKE) --no-print-directory -j$$(nproc) $(MCU_BUILDS)
	@scripts/check/archive $(MCUS)
	@scripts/check/stack >build/stack.txt && tail -n 1 build/stack.txt

.PHONY: install
install: export PREFIX := $(PREFIX)
install: export LIBDIR := $(LIBDIR)
install: export DESTDIR := $(DESTDIR)
install: ## Install the library with its ports, and files for pkg-config and CMake, below PREFIX
	@scripts/build/install --check
	@$(MAKE) --no-print-directory linux
	@scripts/build/install

.PHONY: check-install
check-install: tool ## Install, and build and run the README's program from there
	@scripts/need gcc libc6-dev musl-tools make cmake pkg-config libmbedtls-dev
	@scripts/check/install

.PHONY: size
size: ## Measure the flash and RAM that the library adds, and compare with docs/reports/size.md
	@scripts/bench/size

# The crate with the C functions.
CAPI := capi
HEADER = tool=$$(CARGO="$(CARGO)" scripts/cargo-tool cbindgen 0.29.4) && scripts/build/header "$$tool"
.PHONY: header
header: ## Generate include/mbm.h and its parts from the source
	@$(HEADER)

# The features of the core that firmware may have.
FEATURES := defmt,embedded-io,embedded-io-async,usbd-serial
# The others need another target, or compile C first, or the standard library, with which the archive
# does not compile.
LINTED := --workspace --exclude mbm-example --exclude mbm-embassy-example --exclude mbm-bench --exclude mbm-host-example
.PHONY: check
check: need-check $(ARCHIVE) ## Check formatting, lints, layers, circles, header, docs, functions, spelling, symbols
	@$(CARGO) fmt --all --check
	@$(CARGO) clippy --quiet $(LINTED) --all-targets --features pymodbus,$(FEATURES) -- -D warnings
	@$(CARGO) clippy --quiet $(LINTED) --all-targets -- -D warnings
	@$(CARGO) clippy --quiet -p mbm -p mbm-host-example --all-targets --features pymodbus,std,$(FEATURES) -- -D warnings
	@for feature in std $(subst $(comma), ,$(FEATURES)); do \
		$(CARGO) clippy --quiet --features $$feature -- -D warnings || exit 1; done
	@RUSTDOCFLAGS="-D warnings" $(CARGO) doc --quiet --no-deps
	@RUSTDOCFLAGS="-D warnings" $(CARGO) doc --quiet --no-deps -p mbm --features std,$(FEATURES)
	@CARGO="$(CARGO)" scripts/check/examples
	@$(CARGO) test --quiet -p mbm-tools >/dev/null
	@$(CARGO) run --quiet -p mbm-tools --bin layers
	@$(CARGO) run --quiet -p mbm-tools --bin circles
	@$(HEADER) --check
	@scripts/release/version
	@scripts/check/compiler --page
	@scripts/check/abi
	@clang-format --dry-run --Werror $(C_SOURCES)
	@scripts/check/header
	@$(MAKE) --no-print-directory check-comments
	@scripts/check/functions
	@CARGO="$(CARGO)" scripts/check/names
	@scripts/check/packages
	@scripts/check/kits
	@scripts/check/port-faults
	@scripts/build/project.py --check
	@CARGO="$(CARGO)" scripts/check/dependencies
	@$(MAKE) --no-print-directory spell
	@$(MAKE) --no-print-directory check-pages
	@scripts/check/archive --host $(ARCHIVE)
	@echo "check: formatting, lints, layers, header and symbols are in order"

.PHONY: format
format: ## Format Rust, C and C++ as `make check` requires
	@scripts/need clang-format
	@$(CARGO) fmt --all
	@clang-format -i $(C_SOURCES)

# --- tests. Compiling and tests that wait run side by side.

# One job more than processors, because the tests in Rust often wait for peers.
JOBS ?= $(shell echo $$(($$(nproc) + 1)))
BUILDS := plain sanitized
# The programs in valgrind come first, because they take the longest.
PROGRAMS = $(foreach build,$(filter valgrind,$(BUILDS)) $(filter-out valgrind,$(BUILDS)),$(TESTS:%=$(BUILD)/$(build)/%))

.PHONY: test
test: need-test ## Run every test: Rust, C and C++, also with sanitizers. BUILDS=valgrind runs C and C++ in valgrind
	@rm -rf $(BUILD)/tests
	@$(MAKE) --no-print-directory --keep-going -j$(JOBS) build-rust test-rust run-c-tests; scripts/check/test-totals

.PHONY: nightly
nightly: ## Run what .ci/run leaves out: valgrind, all archives, QEMU, fuzzing, packages, the site in a browser; prints the time of each step
	@.ci/nightly

.PHONY: test-c
test-c: need-test ## Run only C and C++: TESTS="test_ring test_registers" BUILDS="plain valgrind" TEST=one_test
	@$(MAKE) --no-print-directory -j$(JOBS) run-c-tests

.PHONY: build-rust test-rust run-c-tests
build-rust: need-test
	+@CARGO="$(CARGO)" scripts/check/test-rust --build
test-rust: build-rust $(BUILD)/plain/serve venv ## Run only Rust; `cargo test NAME` runs tests with that name
	+@CARGO="$(CARGO)" scripts/check/test-rust
# scripts/check/test-totals compares the results of test_bad_wire with the committed fault table.
run-c-tests: $(PROGRAMS)
	@mkdir -p $(BUILD)/tests
	@MBM_TEST="$(TEST)" scripts/check/run-c-tests $(PROGRAMS) >$(BUILD)/tests/c.txt; code=$$?; cat $(BUILD)/tests/c.txt; \
	tail -n 1 $(BUILD)/tests/c.txt >$(BUILD)/tests/c.total; exit $$code

.PHONY: coverage
coverage: need-test ## Measure the lines that the tests run, Rust and C; writes build/coverage.md
	@scripts/need llvm-22
	@$(MAKE) --no-print-directory venv $(BUILD)/plain/serve
	@CARGO="$(CARGO)" JOBS="$(JOBS)" scripts/bench/coverage
.PHONY: coverage-tests
coverage-tests: $(TESTS:%=$(BUILD)/coverage/%)
	@scripts/check/run-c-tests $^

.PHONY: venv
venv: ## Create the Python environment for tests/peer, build/venv
	@scripts/venv

.PHONY: test-miri
test-miri: ## Check the hooks against Rust's aliasing rules, with Miri of the nightly toolchain
	@$(CARGO) +nightly miri test --quiet --package mbm-c --test reentry
	@MIRIFLAGS=-Zmiri-tree-borrows $(CARGO) +nightly miri test --quiet --package mbm-c --test reentry

.PHONY: fuzz
fuzz: ## Fuzz every decoder and the C API, FUZZ_SECONDS in total (60)
	@scripts/need g++ libc6-dev libmodbus-dev
	@CARGO="$(CARGO)" scripts/check/fuzz

CALLS ?= 10000000
.PHONY: fuzz-api
fuzz-api: ## Fuzz the C API with sequences of calls, CALLS in total (10000000)
	@scripts/need g++ libc6-dev libmodbus-dev
	@CARGO="$(CARGO)" MBM_API_CALLS=$(CALLS) scripts/check/fuzz c_api

MODEL_SECONDS ?= 300
MODEL := --quiet --profile model --package mbm-model --target-dir $(BUILD)/model
.PHONY: model
model: ## Try every order of events around a request, then every stream of bytes, each for MODEL_SECONDS (300)
	@mkdir -p $(BUILD)
	@$(CARGO) test $(MODEL) >$(BUILD)/model.log 2>&1 || { cat $(BUILD)/model.log; exit 1; }
	@$(CARGO) run $(MODEL) -- $(MODEL_SECONDS)

FAULT_TABLES := $(patsubst %,$(BUILD)/plain/test_%,bad_wire slow_devices heard_again server_blocks)
.PHONY: fault-table
fault-table: need-test ## Generate docs/reports/fault-table.md and the table of docs/server.md from the tests' results
	@$(MAKE) --no-print-directory $(FAULT_TABLES)
	@scripts/check/run-c-tests $(FAULT_TABLES)
	@for table in bad_wire slow_devices heard_again; do scripts/fill docs/reports/fault-table.md $$table <$(BUILD)/plain/test_$$table.rows || exit 1; done
	@scripts/fill docs/server.md server_blocks <$(BUILD)/plain/test_server_blocks.rows
	@scripts/build/pictures

.PHONY: conformance
conformance: ## Write the counts and the differences of docs/reports/conformance.md from its tables
	@scripts/need python3
	@scripts/check/functions --write

# Certificates for tests and examples, build/certificates.
.PHONY: certificates
certificates:
	@scripts/need openssl
	@c-tests/certificates $(BUILD)/certificates

.PHONY: corruption
corruption: ## Compute which damage CRC-16 lets through; writes docs/reliability.md; REPLIES (40000000)
	@mkdir -p $(BUILD)
	@MBM_DAMAGED_REPLIES=$(or $(REPLIES),40000000) $(CARGO) test --quiet --release --test crc_limit -- \
		--nocapture --test-threads 1 >$(BUILD)/corruption.log 2>&1 || { cat $(BUILD)/corruption.log >&2; exit 1; }
	@{ sed -n 's/.*row |/|/p' $(BUILD)/corruption.log; echo; sed -n 's/.*said //p' $(BUILD)/corruption.log; } | \
		scripts/fill docs/reliability.md corruption

# The C libraries of those compilers for firmware that are installed. Debian packs each library apart from
# its compiler.
FIRMWARE_LIBC := $(if $(shell command -v arm-none-eabi-gcc),libnewlib-arm-none-eabi) \
	$(if $(shell command -v riscv64-unknown-elf-gcc),picolibc-riscv64-unknown-elf)
.PHONY: need-check need-test
need-check:
	@scripts/need gcc g++ clang gcc-avr avr-libc libc6-dev binutils doxygen clang-format abigail-tools python3 \
		$(FIRMWARE_LIBC)
need-test:
	@scripts/need python3 python3-venv gcc g++ clang libclang-rt-14-dev libc6-dev pkg-config libmodbus-dev libcmocka-dev \
		perl valgrind mbpoll libmbedtls-dev libyaml-dev libcjson-dev liblwip-dev libmosquitto-dev openssl

# With each object the compiler writes a list of the headers that it includes.
DEPENDS := -MMD -MP
OBJECTS := $(wildcard $(foreach folder,plain sanitized coverage aarch64 bench avr-tests linux,$(addprefix $(BUILD)/$(folder)/,*.o */*.o)))
-include $(wildcard $(OBJECTS:.o=.d))
# An object without its list is compiled again.
.PHONY: without-list
$(filter-out $(patsubst %.d,%.o,$(wildcard $(OBJECTS:.o=.d))),$(OBJECTS)): without-list

# The test programs, one folder for each variant: $(1) name, $(2) C compiler, $(3) C++ compiler,
# $(4) flags, $(5) archive
define variant
$(BUILD)/$(1)/%.o: c-tests/%.c
	@mkdir -p $$(@D)
	@$(2) $(DEPENDS) $(CFLAGS) $(4) $(TEST_WARNINGS) $$(INCLUDES) $$(MODBUS) -c $$< -o $$@
$(BUILD)/$(1)/%.o: c-tests/%.cpp
	@mkdir -p $$(@D)
	@$(3) $(DEPENDS) $(CXXFLAGS) $(4) $(TEST_WARNINGS) $$(INCLUDES) $$(MODBUS) -c $$< -o $$@
$(BUILD)/$(1)/%.o: examples/%.c
	@mkdir -p $$(@D)
	@$(2) $(DEPENDS) $(CFLAGS) $(4) $(WARNINGS) $$(INCLUDES) $$(MODBUS) -c $$< -o $$@
$(BUILD)/$(1)/cli/%.o: cli/%.c
	@mkdir -p $$(@D)
	@$(2) $(DEPENDS) $(CFLAGS) $(4) $(WARNINGS) $$(INCLUDES) $(TOOL_FLAGS) -c $$< -o $$@
$(BUILD)/$(1)/cli/live.o: cli/page.html
$(BUILD)/$(1)/%.o: ports/%.c
	@mkdir -p $$(@D)
	@$(2) $(DEPENDS) $(CFLAGS) $(4) $(WARNINGS) $$(INCLUDES) -c $$< -o $$@
$(BUILD)/$(1)/mbm: $(TOOL:%.c=$(BUILD)/$(1)/%.o) $(TOOL_PORTS:ports/%.c=$(BUILD)/$(1)/%.o) $(or $(5),$(ARCHIVE))
	@$(2) $(4) $$(filter %.o,$$^) $(or $(5),$(ARCHIVE)) $(TOOL_LIBS) -o $$@
$(TESTS:%=$(BUILD)/$(1)/%): %: %.o $(patsubst c-tests/%.c,$(BUILD)/$(1)/%.o,$(patsubst ports/%.c,$(BUILD)/$(1)/%.o,$(SUPPORT))) $(or $(5),$(ARCHIVE))
	@$(3) $(4) $$(filter-out $$(WITHOUT),$$(filter %.o,$$^)) $(or $(5),$(ARCHIVE)) $$(LIBS) -o $$@
$(TLS_TESTS:%=$(BUILD)/$(1)/%): $(patsubst c-tests/%.c,$(BUILD)/$(1)/%.o,$(patsubst ports/%.c,$(BUILD)/$(1)/%.o,$(TLS))) | certificates
$(TLS_TESTS:%=$(BUILD)/$(1)/%): LIBS += $(TLS_LIBS)
$(BUILD)/$(1)/test_payload: $(patsubst %,$(BUILD)/$(1)/cli/%.o,names payload conversion decimal value value_dates value_types numbers)
$(BUILD)/$(1)/test_payload: LIBS += -lcjson -lm
$(PICO_TESTS:%=$(BUILD)/$(1)/%): $(patsubst %,$(BUILD)/$(1)/pico/%.o,pico_model mbm_pico_uart mbm_pico_usb)
$(PICO_TESTS:%=$(BUILD)/$(1)/%): INCLUDES += -Ic-tests/pico -Iports/pico
$(STM32_TESTS:%=$(BUILD)/$(1)/%): $(patsubst %,$(BUILD)/$(1)/stm32/%.o,machine chip_model uart served_unit mbm_stm32 mbm_stm32_callbacks)
$(STM32_TESTS:%=$(BUILD)/$(1)/%): INCLUDES += -Ic-tests/stm32 -Iports/stm32
$(BUILD)/$(1)/zephyr/%.o: $(ZEPHYR_STAND_IN)/%.c
	@mkdir -p $$(@D)
	@$(2) $(DEPENDS) $(CFLAGS) $(4) $(WARNINGS) $$(INCLUDES) -c $$< -o $$@
$(BUILD)/$(1)/line/%.o: firmware-tests/line/%.c
	@mkdir -p $$(@D)
	@$(2) $(DEPENDS) $(CFLAGS) $(4) $(WARNINGS) $$(INCLUDES) -c $$< -o $$@
$(ZEPHYR_TESTS:%=$(BUILD)/$(1)/%): $(patsubst %,$(BUILD)/$(1)/%.o,zephyr/mbm_zephyr zephyr/board line/line)
$(ZEPHYR_TESTS:%=$(BUILD)/$(1)/%): INCLUDES := -Ifirmware-tests/line $(INCLUDES) -Ic-tests/zephyr -Iports/zephyr -I$(ZEPHYR_STAND_IN) -I$(ZEPHYR_STAND_IN)/include \
	-DSTAND_IN_UART_KIND=CONFIGURABLE -DCONFIG_UART_INTERRUPT_DRIVEN -DCONFIG_UART_USE_RUNTIME_CONFIGURE
$(BUILD)/$(1)/baremetal/%.o: ports/baremetal/uart/%.c
	@mkdir -p $$(@D)
	@$(2) $(DEPENDS) $(CFLAGS) $(4) $(WARNINGS) $$(INCLUDES) -DPREFIX=u_$$* -include c-tests/baremetal/registers.h -c $$< -o $$@
$(BUILD)/$(1)/test_baremetal: $(patsubst %,$(BUILD)/$(1)/baremetal/%.o,$(BARE_UARTS))
$(BUILD)/$(1)/test_baremetal: INCLUDES := -Ic-tests/baremetal -Iports/baremetal $(INCLUDES)
$(WIZNET_TESTS:%=$(BUILD)/$(1)/%): $(patsubst %,$(BUILD)/$(1)/wiznet/%.o,chip_model mbm_wiznet)
$(WIZNET_TESTS:%=$(BUILD)/$(1)/%): INCLUDES += -Ic-tests/wiznet -Iports/wiznet
$(ESP_IDF_TESTS:%=$(BUILD)/$(1)/%): $(patsubst %,$(BUILD)/$(1)/esp-idf/%.o,uart_model mbm_esp_idf)
$(ESP_IDF_TESTS:%=$(BUILD)/$(1)/%): INCLUDES += -Ic-tests/esp-idf -Iports/esp-idf \
    $(patsubst %,-Ipackaging/esp-idf/stand-in/%/include,common esp_driver_uart esp_driver_gpio esp_timer)
$(RT_THREAD_TESTS:%=$(BUILD)/$(1)/%): $(BUILD)/$(1)/rt-thread/chip.o
$(BUILD)/$(1)/test_rt_thread: $(patsubst %,$(BUILD)/$(1)/rt-thread/%.o,serial_model mbm_rt_thread)
$(BUILD)/$(1)/test_rt_thread_v2: $(BUILD)/$(1)/rt-thread/serial_v2.o
$(BUILD)/$(1)/test_rt_thread_v2_untimed: $(BUILD)/$(1)/rt-thread/serial_v2_untimed.o
$(RT_THREAD_TESTS:%=$(BUILD)/$(1)/%): INCLUDES += -Ic-tests/rt-thread -Iports/rt-thread -Ipackaging/rt-thread/stand-in/include
$(LWIP_TESTS:%=$(BUILD)/$(1)/%): $(patsubst %,$(BUILD)/$(1)/lwip/%.o,mbm_lwip mbm_lwip_listener)
$(LWIP_TESTS:%=$(BUILD)/$(1)/%): INCLUDES += -D_GNU_SOURCE= -Ic-tests/lwip -Iports/lwip -isystem /usr/include/lwip
$(LWIP_TESTS:%=$(BUILD)/$(1)/%): LIBS += -llwip
$(LWIP_RELAY_TESTS:%=$(BUILD)/$(1)/%): $(BUILD)/$(1)/lwip/lwip_relay.o
$(LWIP_WIRE_TESTS:%=$(BUILD)/$(1)/%): $(patsubst %,$(BUILD)/$(1)/lwip/%.o,lwip_wire lwip_pair)
$(LWIP_WIRE_TESTS:%=$(BUILD)/$(1)/%): LIBS += -Wl$(comma)--wrap=tcp_write$(comma)--wrap=tcp_new_ip_type
$(BUILD)/$(1)/test_lwip_examples: $(patsubst %,$(BUILD)/$(1)/lwip/%.o,client serve)
$(patsubst %,$(BUILD)/$(1)/lwip/%.o,client serve): INCLUDES += -Dmain=example_$$(notdir $$*)
# The same sources as on Linux, in place of those objects.
$(BUILD)/$(1)/over_lwip/%.o: ports/linux/%.c
	@mkdir -p $$(@D)
	@$(2) $(DEPENDS) $(CFLAGS) $(4) $(WARNINGS) $$(INCLUDES) -c $$< -o $$@
$(LWIP_SOCKET_TESTS:%=$(BUILD)/$(1)/%): $(LWIP_SOCKETS:%=$(BUILD)/$(1)/%.o)
# Set for each object: what is set for the program holds for Linux's objects too.
$(patsubst %,$(BUILD)/$(1)/%.o,$(LWIP_SOCKET_TESTS) $(LWIP_SOCKETS)): INCLUDES += -DMBM_TCP_OVER_LWIP -Iexamples/lwip
$(LWIP_SOCKET_TESTS:%=$(BUILD)/$(1)/%): WITHOUT = $(patsubst ports/%.c,$(BUILD)/$(1)/%.o,$(wildcard ports/linux/*.c)) $(BUILD)/$(1)/support/tcp_waiting.o
$(PORT_TESTS:%=$(BUILD)/$(1)/%): $(PORT_KIT:%=$(BUILD)/$(1)/%.o)
$(FREERTOS_TESTS:%=$(BUILD)/$(1)/%): $(patsubst ports/%.c,$(BUILD)/$(1)/%.o,$(wildcard ports/freertos/*.c)) $(BUILD)/$(1)/freertos/uart.o
$(FREERTOS_TESTS:%=$(BUILD)/$(1)/%): INCLUDES += -Ic-tests/freertos
$(patsubst c-tests/%.c,$(BUILD)/$(1)/%,$(wildcard c-tests/test_device_*.c)): $(DEVICE_FILES:%.c=$(BUILD)/$(1)/%.o) \
	$(patsubst %,$(BUILD)/$(1)/cli/%.o,home names place yaml_file conversion decimal value value_dates value_types numbers report)
$(BUILD)/$(1)/test_found_port: $(patsubst %,$(BUILD)/$(1)/cli/%.o,port_over clock)
$(patsubst c-tests/%.c,$(BUILD)/$(1)/%,$(wildcard c-tests/test_device_*.c)): LIBS += -lyaml -lcjson -lm
$(EXAMPLES:%=$(BUILD)/$(1)/linux/%): %: %.o $(PORTS:%=$(BUILD)/$(1)/%.o) $(or $(5),$(ARCHIVE))
	@$(2) $(4) $$(filter %.o,$$^) $(or $(5),$(ARCHIVE)) -Wl,--gc-sections -o $$@
$(BUILD)/$(1)/test_example_servers: | $(patsubst %,$(BUILD)/$(1)/linux/%,custom_server custom_client guarded_server)
$(patsubst %,$(BUILD)/$(1)/test_%,gateway gateway_replies gateway_tcp): | $(BUILD)/$(1)/mbm
endef
$(eval $(call variant,plain,gcc,g++,))
$(eval $(call variant,sanitized,clang,clang++,$(SANITIZERS),$(SANITIZED_ARCHIVE)))
# scripts/bench/coverage builds the archive with counters first. It is not trimmed, so its unwind tables
# refer to rust_eh_personality, which is defined as 0 because nothing calls it.
COUNTERS := --coverage -Wl$(comma)-u$(comma)__llvm_profile_runtime -Wl$(comma)--defsym$(comma)rust_eh_personality=0
$(eval $(call variant,coverage,gcc,g++,$(COUNTERS),$(BUILD)/coverage/libmbm.a))
.SECONDARY:

# mbm's server, for the tests with pymodbus's client.
SERVE := $(BUILD)/plain/serve
$(SERVE): $(patsubst %,$(BUILD)/plain/%.o,serve support/served support/pty) $(ARCHIVE)
	@gcc $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -lpthread -o $@

# The programs of the variant `plain` again, which scripts/check/run-c-tests runs in valgrind.
$(TESTS:%=$(BUILD)/valgrind/%): $(BUILD)/valgrind/%: $(BUILD)/plain/%
	@mkdir -p $(@D)
	@ln -sfn ../plain/$* $@

# The same optimisation as that of Debian's libmodbus.
$(eval $(call variant,bench,gcc,g++,-O2))
# nanoMODBUS is measured if NANOMODBUS names a clone of its repository; scripts/bench/speed takes the commit that it
# names from there.
NANO_SOURCE := $(BUILD)/bench/nanomodbus
ifneq ($(NANOMODBUS),)
NANO := $(NANO_SOURCE)/nanomodbus.o $(BUILD)/bench/bench_nano.o
$(NANO_SOURCE)/nanomodbus.c:
	@scripts/bench/speed fetch "$(NANOMODBUS)" $(@D)
$(NANO_SOURCE)/nanomodbus.o: $(NANO_SOURCE)/nanomodbus.c
	@gcc -O2 -g -c $< -o $@
$(BUILD)/bench/bench_nano.o: $(NANO_SOURCE)/nanomodbus.c
$(BUILD)/bench/bench_nano.o $(BUILD)/bench/bench_client.o: MODBUS += -DWITH_NANOMODBUS -isystem $(NANO_SOURCE)
endif
BENCH_CLIENT := $(BUILD)/bench/bench_client
$(BENCH_CLIENT): $(patsubst %,$(BUILD)/bench/%.o,bench_client bench_floor support/pty support/server linux/mbm_tty linux/mbm_tcp) $(NANO) $(ARCHIVE)
	@gcc $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -lmodbus -lpthread -o $@
BENCH_SERVER := $(BUILD)/bench/bench_server
$(BENCH_SERVER): $(patsubst %,$(BUILD)/bench/%.o,bench_server bench_tables bench_loops linux/mbm_tcp linux/mbm_tcp_listener linux/mbm_tcp_set linux/mbm_tty) $(ARCHIVE)
	@gcc $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -lmodbus -o $@
BENCH_GATEWAY := $(BUILD)/bench/bench_gateway
$(BENCH_GATEWAY): $(patsubst %,$(BUILD)/bench/%.o,bench_gateway support/pty)
	@gcc $(filter %.o,$^) -o $@
BENCH_LOOP := $(BUILD)/bench/bench_loop
$(BENCH_LOOP): $(patsubst %,$(BUILD)/bench/%.o,bench_loop linux/mbm_loop linux/mbm_tcp linux/mbm_tcp_listener linux/mbm_tcp_set linux/mbm_tty linux/mbm_udp) $(ARCHIVE)
	@gcc $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -o $@
BENCH_SNIFFER := $(BUILD)/bench/bench_sniffer
$(BENCH_SNIFFER): $(BUILD)/bench/bench_sniffer.o $(ARCHIVE)
	@gcc $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -o $@
BENCH_PLAN := $(BUILD)/bench/bench_plan
$(BENCH_PLAN): $(BUILD)/bench/bench_plan.o $(ARCHIVE)
	@gcc $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections -o $@

.PHONY: bench
bench: ## Compare speed and instructions with other libraries, NANOMODBUS=clone of nanoMODBUS, MBUSD=mbusd; writes docs/reports/speed.md
	@scripts/need gcc libc6-dev pkg-config libmodbus-dev valgrind strace
	@rm -rf $(BUILD)/bench/bench_client.o $(NANO_SOURCE)
	@$(MAKE) --no-print-directory $(BENCH_SERVER) $(BENCH_CLIENT) $(BENCH_LOOP) $(BENCH_SNIFFER) $(BENCH_PLAN) $(BENCH_GATEWAY) $(INSTALLED_TOOL)
	@scripts/bench/speed server $(BENCH_SERVER)
	@CARGO="$(CARGO)" scripts/bench/speed client $(BENCH_CLIENT)
	@scripts/bench/speed loop $(BENCH_LOOP)
	@scripts/bench/speed sniffer $(BENCH_SNIFFER)
	@scripts/bench/speed plan $(BENCH_PLAN)
	@MBUSD="$(MBUSD)" scripts/bench/speed gateway $(BENCH_GATEWAY) $(INSTALLED_TOOL)
	@CARGO="$(CARGO)" scripts/bench/speed frames
	@scripts/build/pictures

# Programs with TLS or UDP, which pymodbus talks with too.
SECURE := $(BUILD)/plain/linux/secure_server
$(SECURE): $(patsubst %,$(BUILD)/plain/linux/%.o,secure_server mbm_tls mbm_tls_identity mbm_tls_linux mbm_tls_listener mbm_tls_text mbm_tcp mbm_tcp_listener) $(ARCHIVE)
	@gcc $(filter %.o,$^) $(ARCHIVE) -Wl,--gc-sections $(TLS_LIBS) -o $@

.PHONY: measure-secure
measure-secure: ## Measure what handshakes cost other clients of that server, and who gets in under attack
	@scripts/need python3 gcc libc6-dev libmbedtls-dev openssl
	@$(MAKE) --no-print-directory certificates $(SECURE)
	@python3 scripts/bench/secure $(SECURE) $(BUILD)/certificates

SERVE_MANY := $(BUILD)/plain/serve_many
$(SERVE_MANY): $(patsubst %,$(BUILD)/plain/%.o,serve_many support/server support/pty) $(ARCHIVE)
	@gcc $(filter %.o,$^) -lmodbus -lpthread -o $@

PEERS := $(BUILD)/plain/serve_libmodbus
$(PEERS): $(patsubst %,$(BUILD)/plain/%.o,serve_libmodbus support/server support/tcp_server support/pty) $(ARCHIVE)
	@gcc $(filter %.o,$^) -lmodbus -lpthread -o $@

.PHONY: tool
tool: ## Build the command line tool, build/plain/mbm
	@scripts/need $(filter-out help2man,$(TOOL_NEEDS))
	@$(MAKE) --no-print-directory $(BUILD)/plain/mbm
	@echo "tool: $(BUILD)/plain/mbm"

# The tool as it is installed: optimised and hardened, over the library of the ports.
INSTALLED_TOOL := $(BUILD)/linux/mbm
HARDENED := -O2 -D_FORTIFY_SOURCE=2 -fstack-protector-strong -fPIE
$(BUILD)/linux/cli/%.o: cli/%.c
	@mkdir -p $(@D)
	@gcc $(DEPENDS) -std=c11 $(HARDENED) $(TOOL_FLAGS) -Iinclude -Iports/linux -c $< -o $@
$(BUILD)/linux/cli/live.o: cli/page.html
$(INSTALLED_TOOL): linux $(TOOL:%.c=$(BUILD)/linux/%.o)
	@gcc -pie -Wl,-z,relro,-z,now,--as-needed $(filter %.o,$^) $(BUILD)/linux/libmbm-tls.a $(LIBRARY) $(TOOL_LIBS) -o $@

# That tool with its man pages.
.PHONY: tool-parts
tool-parts:
	@scripts/need $(TOOL_NEEDS)
	@[ -f $(INSTALLED_TOOL) ] || echo "tool: compiles $(words $(TOOL)) files in C and the library"
	@$(MAKE) --no-print-directory -j$$(nproc) $(INSTALLED_TOOL)
	@cli/man $(INSTALLED_TOOL) $(BUILD)/man

.PHONY: install-tool
install-tool: export PREFIX := $(PREFIX)
install-tool: export DESTDIR := $(DESTDIR)
install-tool: ## Install that tool, its man pages, completion, units of systemd and examples below PREFIX
	@scripts/build/install-tool --check
	@$(MAKE) --no-print-directory tool-parts
	@scripts/build/install-tool

.PHONY: man
man: tool ## Make the man pages of that tool, build/man
	@scripts/need help2man
	@cli/man $(BUILD)/plain/mbm $(BUILD)/man

# ONLY is an expression of pytest's -k: words of names, with and, or and not. DEVICES (1000) and MANY_SECONDS (20) are those of
# the test of many_devices.
TOOL_PEERS := $(PEERS) $(SERVE_MANY) $(SECURE) $(addprefix $(BUILD)/plain/linux/,calls keep_link many_devices udp)
.PHONY: test-tool test-tool-programs
test-tool: test-tool-programs ## Test that tool and programs of examples/linux on other clients, servers and brokers: ONLY="tls or udp"
	@DEVICES="$(DEVICES)" MANY_SECONDS="$(MANY_SECONDS)" \
		$(BUILD)/venv/bin/python -B -m pytest -c tests/tool/pytest.ini --rootdir tests/tool tests/tool $(if $(ONLY),-k "$(ONLY)")
test-tool-programs: man
	@scripts/need python3 python3-venv gcc g++ clang libclang-rt-14-dev libc6-dev gcc-avr avr-libc gcc-arm-none-eabi libnewlib-arm-none-eabi \
		pkg-config libmodbus-dev libmbedtls-dev mbpoll mosquitto mosquitto-clients openssl strace tshark
	@$(MAKE) --no-print-directory venv certificates $(BUILD)/sanitized/mbm $(TOOL_PEERS)

.PHONY: demo plan
demo: tool ## Show every function against a libmodbus server, frame by frame, and a plan at work
	@scripts/need gcc libc6-dev pkg-config libmodbus-dev python3
	@$(MAKE) --no-print-directory $(PEERS)
	@scripts/demo
	@$(MAKE) --no-print-directory plan
plan: tool ## A plan of ten fields at work against a libmodbus server
	@$(MAKE) --no-print-directory $(PEERS)
	@scripts/demo plan

# The tests in C as programs for AArch64, run by QEMU's user mode. The machine stays as it is: the
# libraries for AArch64 are unpacked below build.

AARCH64 := aarch64-linux-gnu
AARCH64_FOLDER := $(BUILD)/machines/$(AARCH64)
AARCH64_ARCHIVE := $(AARCH64_FOLDER)/libmbm.a
AARCH64_ROOT := $(AARCH64_FOLDER)/root
AARCH64_LIBRARIES := $(AARCH64_ROOT)/usr/lib/$(AARCH64)

.PHONY: archive-aarch64 test-aarch64 $(AARCH64_ARCHIVE)
# Phony, because Cargo decides what is out of date.
$(AARCH64_ARCHIVE):
	@scripts/need binutils-aarch64-linux-gnu
	+@CARGO="$(CARGO)" MBM_MACHINE=$(AARCH64) scripts/build/archive --host $@
archive-aarch64: $(AARCH64_ARCHIVE) ## Build the library with its ports for 64-bit Arm Linux, build/machines/aarch64-linux-gnu/linux
	@scripts/need gcc-aarch64-linux-gnu libc6-dev-arm64-cross
	@MBM_MACHINE=$(AARCH64) scripts/build/ports $(AARCH64_ARCHIVE) $(AARCH64_FOLDER)/linux
	@echo "archive-aarch64: $(AARCH64_FOLDER)/linux/libmbm.a, by $$(cat $(AARCH64_FOLDER)/compiler)"

# The old tag of -rpath counts for the libraries of libraries too.
$(eval $(call variant,aarch64,$(AARCH64)-gcc,$(AARCH64)-g++,-isystem $(AARCH64_ROOT)/usr/include -isystem $(AARCH64_ROOT)/usr/include/lwip \
    -L$(AARCH64_LIBRARIES) -Wl$(comma)--disable-new-dtags$(comma)-rpath$(comma)$(CURDIR)/$(AARCH64_LIBRARIES),$(AARCH64_ARCHIVE)))

test-aarch64: ## Run the tests in C as programs for AArch64 under QEMU: TESTS, TEST as for test-c
	@scripts/need gcc-aarch64-linux-gnu g++-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user perl mbpoll openssl \
		pkg-config libmodbus-dev
	@scripts/need --unpack arm64 $(AARCH64_ROOT) libmodbus-dev libmodbus5 libcmocka-dev libcmocka0 libyaml-dev libyaml-0-2 libcjson-dev libcjson1 \
		liblwip-dev liblwip0 libmosquitto-dev libmosquitto1 libssl3 \
		libmbedtls-dev libmbedtls14 libmbedx509-1 libmbedcrypto7
	@$(MAKE) --no-print-directory -j$(JOBS) run-c-tests BUILDS=aarch64

# Checks, and the pages.
include scripts/check/check.mk
# Everything for Arduino and the AVR simulator.
include firmware-tests/avr/avr.mk
include firmware-tests/qemu/qemu.mk
include firmware-tests/rp2040/rp2040.mk
# The packages in dist/, and releases.
include packaging/packaging.mk

.PHONY: test-firmware
test-firmware: ## Run firmware on simulated chips against a libmodbus server
	@$(MAKE) --no-print-directory test-firmware-avr
	@$(MAKE) --no-print-directory test-firmware-qemu
	@$(MAKE) --no-print-directory test-firmware-rp2040
	@echo "test-firmware: sketches on AVR boards, bare metal on QEMU and a Pico over USB work"
