# The bare metal firmware on machines that QEMU plays.

BAREMETAL := examples/baremetal/Makefile
# From the firmware's Makefile.
MACHINES = $(shell $(MAKE) -s --no-print-directory -f $(BAREMETAL) machines)
VARIANTS = $(shell $(MAKE) -s --no-print-directory -f $(BAREMETAL) variants)

# The test kit for ports runs from the archives alone.
PORT_QEMU_TEST := $(BUILD)/firmware/test_porttest
# This needs no archive, so it runs once.
RUST_QEMU_TEST := $(BUILD)/firmware/test_rust
QEMU_TESTS := $(filter-out $(RUST_QEMU_TEST),$(patsubst firmware-tests/qemu/%.c,$(BUILD)/firmware/%,$(wildcard firmware-tests/qemu/test_*.c)))
QEMU_SOURCES := $(filter-out firmware-tests/qemu/test_%,$(wildcard firmware-tests/qemu/*.c)) \
                $(patsubst %,c-tests/support/%.c,pty server model)
QEMU_FLAGS = $(CFLAGS) $(TEST_WARNINGS) -Iinclude -Ic-tests/support -Iexamples/baremetal -Iports/baremetal $(MODBUS)
$(QEMU_TESTS) $(RUST_QEMU_TEST): $(BUILD)/firmware/%: firmware-tests/qemu/%.c $(QEMU_SOURCES) $(wildcard firmware-tests/qemu/*.h c-tests/support/*.h examples/baremetal/*.h ports/baremetal/*.h include/mbm/*.h)
	@mkdir -p $(@D)
	@gcc $(QEMU_FLAGS) $< $(QEMU_SOURCES) \
		-lmodbus -lcmocka -lpthread -o $@

# The images with the library as two files, mbm.h and mbm.S, with the parts that the program includes.
FROM_SOURCE := $(BUILD)/baremetal-source
SINGLE_PARTS_main := master
SINGLE_PARTS_serve := server values
SINGLE_PARTS_client := client ring

.PHONY: test-firmware-rust
test-firmware-rust: ## Run firmware in Rust on a Cortex-M7 in QEMU, over the traits of embedded-io, and on embassy
	@scripts/need gcc libc6-dev pkg-config libmodbus-dev libcmocka-dev qemu-system-arm gcc-arm-none-eabi
	@CARGO="$(CARGO)" examples/rust/build $(BUILD)/baremetal/mps2-an500
	@$(MAKE) -s --no-print-directory $(RUST_QEMU_TEST)
	@scripts/check/run-c-tests $(RUST_QEMU_TEST)

.PHONY: test-firmware-qemu
test-firmware-qemu: ## Run bare metal firmware on eight machines in QEMU: Arm, RISC-V, Xtensa
	@scripts/need gcc libc6-dev pkg-config libmodbus-dev libcmocka-dev qemu-system-arm qemu-system-misc \
		gcc-arm-none-eabi gcc-riscv64-unknown-elf gcc-xtensa-lx106 clang-22 llvm-22
	@set -e; for machine in $(MACHINES); do \
		scripts/build/archive $$($(MAKE) -s --no-print-directory -f $(BAREMETAL) mcu MACHINE=$$machine); \
		$(MAKE) -s --no-print-directory -f $(BAREMETAL) MACHINE=$$machine; \
		$(MAKE) -s --no-print-directory -f $(BAREMETAL) MACHINE=$$machine PROGRAM=serve; \
		$(MAKE) -s --no-print-directory -f $(BAREMETAL) MACHINE=$$machine PROGRAM=porttest; \
	done
	@set -e; for variant in $(VARIANTS); do for program in main porttest; do \
		$(MAKE) -s --no-print-directory -f $(BAREMETAL) MACHINE=$$variant PROGRAM=$$program; done; done
	@$(MAKE) -s --no-print-directory assembler
	@set -e; \
	build() { \
		machine=$$1 program=$$2; shift 2; \
		scripts/build/single "$$($(MAKE) -s --no-print-directory -f $(BAREMETAL) mcu MACHINE=$$machine)" \
			$(FROM_SOURCE)/single-$$machine-$$program "$$@" >/dev/null; \
		$(MAKE) -s --no-print-directory -f $(BAREMETAL) MACHINE=$$machine PROGRAM=$$program \
			OUT=$(FROM_SOURCE)/$$machine SOURCE=$(FROM_SOURCE)/single-$$machine-$$program; \
	}; \
	for machine in $(MACHINES); do build $$machine main $(SINGLE_PARTS_main); build $$machine serve $(SINGLE_PARTS_serve); done; \
	for variant in $(VARIANTS); do build $$variant main $(SINGLE_PARTS_client); done
	@$(MAKE) -s --no-print-directory $(QEMU_TESTS)
	@$(MAKE) -s --no-print-directory test-firmware-rust
	@MBM_TEST_JOBS=1 MBM_TEST_SECONDS=1200 scripts/check/run-c-tests $(QEMU_TESTS)
	@MBM_FIRMWARE=$(FROM_SOURCE) MBM_TEST_JOBS=1 MBM_TEST_SECONDS=1200 scripts/check/run-c-tests $(filter-out $(PORT_QEMU_TEST),$(QEMU_TESTS))
	@echo "test-firmware-qemu: $(words $(MACHINES)) machines ($(MACHINES)) against libmodbus, server and client, and a bad wire; from archives, and from mbm.S"
