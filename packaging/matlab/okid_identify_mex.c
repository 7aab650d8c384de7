// SPDX-License-Identifier: MIT
// PURPOSE  libokid_host for MATLAB and GNU Octave: options as JSON, inputs and outputs as matrices in, okid.result/1 out
// METHOD   the columns of both matrices are read where they stand; okid_identify.m is the function to call
#include <mex.h>
#include <okid_host.h>

#include <string.h>

static okid_host_columns_t columns_of(const mxArray* matrix) {
    const ptrdiff_t rows = (ptrdiff_t)mxGetM(matrix);
    const okid_host_columns_t columns = {rows > 0 ? mxGetData(matrix) : NULL, 0, rows > 0 ? mxGetN(matrix) : 0,
                                         (ptrdiff_t)sizeof(double), rows * (ptrdiff_t)sizeof(double)};
    return columns;
}

void mexFunction(int n_left, mxArray* left[], int n_right, const mxArray* right[]) {
    if (n_right != 3 || n_left > 1 || !mxIsChar(right[0]) || !mxIsDouble(right[1]) || !mxIsDouble(right[2]) ||
        mxIsComplex(right[1]) || mxIsComplex(right[2]))
        mexErrMsgIdAndTxt("okid:arguments", "okid_identify_mex (options as JSON, inputs, outputs): expected text and "
                                            "two real matrices");
    if (!mxIsEmpty(right[1]) && mxGetM(right[1]) != mxGetM(right[2]))
        mexErrMsgIdAndTxt("okid:samples", "inputs have %d samples, outputs %d: expected as many", (int)mxGetM(right[1]),
                          (int)mxGetM(right[2]));
    if (okid_host_abi() != OKID_HOST_ABI)
        mexErrMsgIdAndTxt("okid:abi", "libokid_host has interface %d, expected %d: compile again", (int)okid_host_abi(),
                          OKID_HOST_ABI);
    char* options = mxArrayToString(right[0]);
    const okid_host_columns_t inputs = columns_of(right[1]), outputs = columns_of(right[2]);
    const size_t count = mxGetM(right[2]);
    const char* const name = "record";
    okid_host_result_t* result = NULL;
    const int32_t code = okid_host_identify_columns(options, 1, &inputs, &outputs, &count, &name, NULL, NULL, &result);
    mxFree(options);
    if (code != 0) mexErrMsgIdAndTxt(code == 3 ? "okid:model" : "okid:input", "%s", okid_host_error());
    left[0] = mxCreateString(okid_host_result_json(result));
    okid_host_result_delete(result);
}
