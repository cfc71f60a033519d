% Calls a user's function in MATLAB, in a process of Octave that may crash.
% Run as: octave-cli octave_runner.m FOLDER CALLS, with a plan of the call in JSON in the folder.
1;
function put(file, text)
    out = fopen(file, 'w');
    fputs(out, text);
    fclose(out);
end
function numbers = doubles(file, shape)
    in = fopen(file, 'r');
    numbers = fread(in, shape, 'double=>double');
    fclose(in);
end
function array = arranged(numbers, shape)
    if numel(shape) == 2
        array = reshape(numbers, shape(2), shape(1));
    else
        array = numbers(:);
    end
end
function run(folder, calls)
    plan = jsondecode(fileread(fullfile(folder, 'plan')), 'makeValidName', false);
    addpath(plan.folder);
    kind = 'double';
    if strcmp(plan.type, 'float')
        kind = 'single';
    end
    identity = cast(doubles(fullfile(folder, 'identity'), Inf), kind);
    rows = doubles(fullfile(folder, 'input'), [Inf]);
    rows = reshape(rows, [], calls);
    count = numel(plan.parameters);
    outputs = zeros(numel(identity), calls);
    state = identity;
    for k = 1:calls
        row = rows(:, k);
        if row(1)
            clear(plan.function);
            state = identity;
            if ~isempty(plan.init)
                feval(plan.init);
            end
        end
        given = cell(1, count);
        place = 4;
        for name = {'previous', 'increments', 'rates'}
            for n = 1:count
                if strcmp(plan.parameters{n}{1}, name{1})
                    shape = plan.parameters{n}{2};
                    given{n} = cast(arranged(row(place:place + prod(shape) - 1), shape), kind);
                    place = place + prod(shape);
                end
            end
        end
        for n = 1:count
            switch plan.parameters{n}{1}
                case 'state'
                    given{n} = arranged(state, plan.parameters{n}{2});
                    if numel(plan.parameters{n}{2}) == 2
                        given{n} = given{n}.';
                    end
                case 'dt'
                    given{n} = row(2);
                case 'step'
                    given{n} = row(3);
            end
        end
        try
            returned = feval(plan.function, given{:});
        catch caught
            text = regexprep(caught.message, '\s+', ' ');
            if strncmp(text, 'parse error', 11)
                put(fullfile(folder, 'refused'), [plan.module ' cannot be read: ' text]);
            elseif ~isempty(strfind(text, 'called with too many inputs'))
                put(fullfile(folder, 'refused'), [plan.function ' does not take these --arguments: ' text]);
            else
                put(fullfile(folder, 'stopped'), ['it raises an error: ' text]);
            end
            return;
        end
        if ~isnumeric(returned) || numel(returned) ~= numel(identity)
            put(fullfile(folder, 'refused'), sprintf('%s gives an array of the shape [%s]; %d numbers are needed', ...
                plan.function, num2str(size(returned)), numel(identity)));
            return;
        end
        if numel(identity) == 9 && size(returned, 1) == 3
            returned = returned.';
        end
        state = cast(returned(:), kind);
        outputs(:, k) = double(state);
    end
    out = fopen(fullfile(folder, 'output'), 'w');
    fwrite(out, outputs, 'double');
    fclose(out);
    put(fullfile(folder, 'flags'), '0');
end
words = argv();
run(words{end - 1}, str2double(words{end}));
